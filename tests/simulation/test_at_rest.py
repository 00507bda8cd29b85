"""A body under loads that change, beside recordings of several times and between two of them."""

import json
from dataclasses import replace

import numpy as np
import pytest
from changing_block import block, displacements, falling, level, recorded
from command import run

from warpbrain.cases.case import Case
from warpbrain.cases.writing import write_case
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.recordings.recording import ForceRecording, SurfaceRecording
from warpbrain.simulation.observation import observe

pytestmark = pytest.mark.usefixtures("undrawn")

TIMES = (10.0, 40.0, 80.0)


def of_all_kinds(truth: Case) -> Case:
    """Points, a surface and a force: at their times, and from a state that is loaded."""
    fields = displacements(truth, TIMES)
    side = truth.mesh.node_sets["side"]
    changed = fields[80.0] - fields[10.0]
    surface = SurfaceRecording(
        name="wall",
        file="w.csv",
        nodes="side",
        points=(truth.mesh.points + changed)[side],
        time=np.full(int(side.sum()), 80.0),
        reference=10.0,
    )
    # the table carries what weighs more
    weights = [_weight(truth, time) for time in (10.0, 80.0)]
    force = ForceRecording(
        name="cell",
        file="c.csv",
        boundary="table",
        time=np.array([40.0, 80.0]),
        force=np.array([[0.0, 0.0, _weight(truth, 40.0) - weights[0]], [0.0, 0.0, weights[1] - weights[0]]]),
        reference=10.0,
    )
    points = recorded(truth, TIMES, 6, noise=0.0)
    between = recorded(truth, (40.0, 80.0), 6, name="between", reference=10.0, noise=0.0)
    return replace(truth, recordings=(points, between, surface, force))


def _weight(case: Case, time: float) -> float:
    """What a fluid no longer carries [N], by its volume."""
    area, height = 0.06**2, 0.06
    fluid = 1007.0 * 9.81 * area
    return sum(m.factor(time) * fluid * (height - m.csf_level) for m in case.mechanisms if isinstance(m, Gravity))


def test_run_compares_each_time_with_its_state(tmp_path, verify) -> None:
    truth = block(4, falling((10.0, 80.0), (0.05, 0.02)))
    folder = write_case(tmp_path / "case", of_all_kinds(truth)).parent
    ran = run(folder, "--out", tmp_path / "out", "--tolerance", "1e-8")
    assert (ran.status, ran.err) == (0, "")
    compared = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))["recordings"]
    by_name = {one["name"]: one for one in compared["compared"]}
    assert set(by_name) == {"beads", "between", "wall", "cell"}
    assert [by_name[name]["count"] for name in ("beads", "between", "cell")] == [18, 12, 2]
    errors = [one["after"]["root_mean_square"] / one["before"]["root_mean_square"] for one in by_name.values()]
    verify(
        "displacements, a surface and a force at several times, and counted from a loaded state, as `run` has them",
        "each state solved by itself, and the weight of a volume by hand",
        max(errors),
        1e-4,
    )


def test_a_head_that_is_turned_between_two_scans(verify) -> None:
    turns = (
        Gravity(direction=(0.0, 0.0, -1.0), density=1000.0, ramp=((1.0, 1.0), (2.0, 0.0))),
        Gravity(direction=(1.0, 0.0, 0.0), density=1000.0, ramp=((1.0, 0.0), (2.0, 1.0))),
    )
    truth = block(4, turns)
    fields = displacements(truth, (1.0, 2.0))
    alone = [displacements(block(4, (replace(turn, ramp=()),)), (np.inf,))[np.inf] for turn in turns]
    size = float(np.abs(alone[1] - alone[0]).max())
    verify(
        "displacement of a body from one pose to another",
        "difference of two bodies, each in one pose",
        float(np.abs((fields[2.0] - fields[1.0]) - (alone[1] - alone[0])).max()) / size,
        1e-9,
    )


def test_what_a_state_alone_cannot_tell_is_left_out() -> None:
    truth = block(3, (level(0.02, ((0.0, 0.0), (100.0, 1.0))),))
    case = replace(truth, recordings=(recorded(truth, (50.0, 100.0), 4, noise=0.0),))
    end = _State(truth, displacements(truth, (np.inf,))[np.inf])
    [points] = observe(case, end).comparisons
    # at 50 s half as much acts
    assert points.count == 4 and points.after.root_mean_square < 1e-6
    between = replace(case, recordings=(replace(case.recordings[0], reference=50.0),))
    assert "which this run does not compute" in observe(between, end).skipped[0]


class _State:
    def __init__(self, case: Case, u: np.ndarray) -> None:
        self.mesh, self.u, self.reactions = case.mesh, u, np.zeros_like(u)


@pytest.mark.parametrize("until", [40.0, 80.0])
def test_a_run_in_time_compares_all_times_that_it_passed(until: float, tmp_path) -> None:
    truth = block(3, falling((10.0, 80.0), (0.05, 0.02)))
    case = replace(
        truth,
        recordings=(
            recorded(truth, TIMES, 5, noise=0.0),
            recorded(truth, (40.0,), 5, name="between", reference=10.0, noise=0.0),
        ),
    )
    folder = write_case(tmp_path / "case", case).parent
    ran = run(folder, "--until", until, "--steps", "3", "--out", tmp_path / "out", "--tolerance", "1e-8")
    assert (ran.status, ran.err) == (0, "")
    compared = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))["recordings"]["compared"]
    assert [one["count"] for one in compared] == [10 if until == 40.0 else 15, 5]
    assert all(one["after"]["root_mean_square"] < 1e-4 * one["before"]["root_mean_square"] for one in compared)
