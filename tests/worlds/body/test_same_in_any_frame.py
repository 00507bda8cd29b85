"""What is concluded does not depend on how a body lies, which way round it is, or how nodes and points are counted."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from sinking_block import write_sinking

from warpbrain.cases.case import Case
from warpbrain.errors import SolveError
from warpbrain.inference.calibration import calibration
from warpbrain.inference.decide import decide
from warpbrain.mesh import TetMesh
from warpbrain.mesh.quality import extent
from warpbrain.worlds.body.hypotheses import HypothesisSearch, screened
from warpbrain.worlds.body.states import States

_KINDS = ("gravity", "pressure", "swelling", "traction")


# two processes would each make what these tests share
pytestmark = pytest.mark.xdist_group("any frame")


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Case:
    """The block that sinks, its nodes off their lattice, so that no two places are alike."""
    case = write_sinking(Path(tmp_path_factory.mktemp("frame")) / "case")
    mesh = case.mesh
    points = mesh.points + 5e-4 * np.random.default_rng(1).normal(size=mesh.points.shape)
    fitted = tuple(one for one in case.recordings if one.role == "fit")
    return replace(case, mesh=TetMesh(points, mesh.tetrahedra, mesh.tissue, mesh.node_sets, {}), recordings=fitted)


def in_frame(case: Case, R: np.ndarray, shift: np.ndarray) -> Case:
    """Turned or mirrored, then shifted."""
    mesh, [beads] = case.mesh, case.recordings
    tetrahedra = mesh.tetrahedra if np.linalg.det(R) > 0.0 else mesh.tetrahedra[:, [0, 2, 1, 3]]
    turned = TetMesh(mesh.points @ R.T + shift, tetrahedra, mesh.tissue, mesh.node_sets, {})
    moved = replace(beads, points=beads.points @ R.T + shift, displacement=beads.displacement @ R.T)
    axis = tuple((R @ np.array(case.gravity_axis)).tolist())
    return replace(case, mesh=turned, recordings=(moved,), gravity_axis=axis)


def counted_anew(case: Case) -> Case:
    """With nodes, elements and recorded points in another order."""
    rng = np.random.default_rng(2)
    mesh, [beads] = case.mesh, case.recordings
    order, elements = rng.permutation(len(mesh.points)), rng.permutation(len(mesh.tetrahedra))
    where = np.argsort(order)
    anew = TetMesh(
        mesh.points[order],
        where[mesh.tetrahedra][elements].astype(np.int32),
        mesh.tissue[elements],
        {name: members[order] for name, members in mesh.node_sets.items()},
        {},
    )
    points = rng.permutation(len(beads.points))
    moved = replace(beads, points=beads.points[points], displacement=beads.displacement[points])
    return replace(case, mesh=anew, recordings=(moved,))


_TURN = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
_ANEW: dict[str, Callable[[Case], Case]] = {
    "turned, mirrored and shifted": lambda case: in_frame(
        case, -_TURN * np.linalg.det(_TURN), np.array([0.3, -0.2, 0.1])
    ),
    "counted anew": counted_anew,
}


def search(case: Case) -> HypothesisSearch:
    return screened(case, "cpu", mesh_error=False, mechanisms=_KINDS)


@pytest.fixture(scope="module")
def as_it_is(case: Case) -> HypothesisSearch:
    return search(case)


@pytest.mark.slow(8)
@pytest.mark.parametrize("change", ["turned, mirrored and shifted", "counted anew"])
def test_sets_are_as_probable(change: str, case: Case, as_it_is: HypothesisSearch) -> None:
    found = search(_ANEW[change](case))
    chances = dict(zip((one.names for one in found.weighted_sets), found.probabilities.tolist(), strict=True))
    for one, chance in zip(as_it_is.weighted_sets, as_it_is.probabilities.tolist(), strict=True):
        if chance > 1e-6:
            assert chances[one.names] == pytest.approx(chance, abs=1e-6)
    losses = calibration().losses
    said = [
        decide([one.hypothesis for one in own.weighted_sets], own.probabilities, losses)[0] for own in (as_it_is, found)
    ]
    assert said[0] == said[1]


def test_the_largest_displacement_of_a_state_is_the_same_in_any_axes() -> None:
    """Seed 40400 of `same-diagnose`: a step of a fit led to a state in one frame and to none in another."""
    points = np.random.default_rng(0).normal(size=(9, 3))
    for R in (np.eye(3), _TURN):
        model = SimpleNamespace(mesh=SimpleNamespace(points=points @ R.T), reactions=lambda *_: None)
        system: Any = SimpleNamespace(model=model)
        for part in (0.99, 1.01):
            u = np.zeros((9, 3))
            u[4] = part * extent(points) * R[:, 0]
            state: Any = SimpleNamespace(u=u, internal=u)
            if part < 1.0:
                States._instant(0.0, system, state, u)
                continue
            with pytest.raises(SolveError, match="more than its size"):
                States._instant(0.0, system, state, u)
