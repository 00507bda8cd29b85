"""`run`: the same state as its parts give, and as `warpbrain run` writes."""

import json
from dataclasses import replace

import numpy as np
import pytest
from command import run as run_command
from folders import write_folder, write_recorded
from testing_machine import CUBE, case_of, recorded, simulate_test

from warpbrain.cases.reading import read_case
from warpbrain.errors import InputError
from warpbrain.recordings.recording import PointsRecording
from warpbrain.simulation.dynamics import Simulator
from warpbrain.simulation.equilibrium import solve_equilibrium
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.run import Course, Running, Watching, run
from warpbrain.simulation.system import System


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    return read_case(write_recorded(tmp_path_factory.mktemp("block")))


def test_it_is_the_equilibrium_of_the_model(case):
    done = run(case, elements="tet4", device="cpu")
    u = solve_equilibrium(System(model_of(case), "cpu")).u
    np.testing.assert_allclose(done.u, u, atol=1e-9 * np.abs(u).max())
    assert done.followed.solution["kind"] == "equilibrium" and done.followed.time is None
    before, after = done.errors["beads"]
    assert before == pytest.approx(np.sqrt(np.mean(np.sum(case.recordings[0].displacement ** 2, axis=1))))
    assert after == done.observed.comparisons[0].after.root_mean_square


@pytest.mark.usefixtures("undrawn")
def test_the_command_writes_the_same(case, tmp_path):
    done = run(str(case.folder), device="cpu")
    assert run_command(case.folder, "--out", tmp_path / "out").status == 0
    written = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert written["result"]["displacement_mm"]["all nodes"]["largest"] == pytest.approx(
        1000.0 * np.linalg.norm(done.u, axis=1).max(), rel=1e-9
    )
    assert written["case"]["elements"] == done.model.elements
    assert written["recordings"]["compared"][0]["after"]["root_mean_square"] == pytest.approx(
        1000.0 * done.errors["beads"][1], rel=1e-9
    )


def test_steps_are_told(case):
    told = []
    running = Running(case, Course(steps=12), device="cpu")
    done = running.run(Watching(motion=lambda number, time, noted: told.append((number, time, noted))))
    assert [number for number, _, _ in told] == list(range(1, 13))
    assert told[-1][1] == pytest.approx(0.012) == done.followed.time
    assert [noted for _, _, noted in told if noted] == done.followed.solution["history"]


def test_a_motion_is_compared_at_each_time_that_it_passes(case):
    simulator = Simulator(System(model_of(case), "cpu"))
    places = case.mesh.points[-4:]
    times = [0.003, 0.0052, 0.04]
    moved = {}
    for step in range(1, 13):
        simulator.step_to(step / 12)
        moved[step] = simulator.system.u.numpy()[-4:].copy()
    # of the last time, that the motion does not reach, nothing is compared
    displacement = np.concatenate([moved[3], moved[5], np.ones((4, 3))])
    points, time = np.tile(places, (3, 1)), np.repeat(times, 4)
    beads = PointsRecording(name="beads", file="b.csv", points=points, time=time, displacement=displacement)
    done = run(replace(case, recordings=(beads,)), steps=12, elements="tet4", device="cpu")
    [compared] = done.observed.comparisons
    assert compared.count == 8 and compared.after.root_mean_square < 1e-12 < compared.before.root_mean_square


def test_a_motion_to_rest_ends_at_the_equilibrium(case):
    rest = run(case, to_rest=True, elements="tet4", device="cpu")
    still = run(case, elements="tet4", device="cpu")
    np.testing.assert_allclose(rest.u, still.u, atol=1e-5 * np.abs(still.u).max())


def test_slow_change_keeps_the_recorded_moments(tmp_path):
    case = read_case(write_folder(tmp_path))
    told = []
    running = Running(case, Course(until=2.0, steps=4), device="cpu")
    done = running.run(Watching(slow=lambda number, count, noted: told.append((number, count, noted["time_s"]))))
    assert told[-1] == (len(told), len(told), 2.0) and done.followed.time == 2.0


@pytest.fixture(scope="module")
def specimen_case():
    return replace(case_of(CUBE), recordings=(recorded("axial", [0.0, -2e-4, -4e-4], [0.0, -0.001, -0.002]),))


def test_a_specimen_is_run_test_by_test(specimen_case):
    done = run(specimen_case, device="cpu")
    (test,) = done.tests
    alone = simulate_test(specimen_case, test.recording, "cpu")
    np.testing.assert_allclose(test.result.response, alone.response, rtol=1e-6, atol=1e-12)
    assert set(done.errors) == {test.recording.name}
    with pytest.raises(InputError, match="tests are quasi-static"):
        run(specimen_case, steps=3)
    with pytest.raises(InputError, match="nothing is imposed on the"):
        run(replace(specimen_case, recordings=()))
