"""A traction on the wall of a cavity that is first looked for on the outer surface, from which no fit goes over."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from gel import block_of_gel, with_beads

from warpbrain.mesh import TetMesh
from warpbrain.physics.mechanisms.traction import Traction
from warpbrain.simulation.equilibrium import EquilibriumSolver
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System
from warpbrain.worlds.body.hypotheses import HypothesisSearch, screened
from warpbrain.worlds.body.placing import with_refined_places
from warpbrain.worlds.body.weighing import best_of_placements
from warpbrain.worlds.body.weighted_set import WeightedSet

#: Edge [m], noise [m], tracked points.
SIDE, NOISE, POINTS = 0.06, 4e-4, 40
#: Of the cavity, as far from the top as from its own other side [m].
LOW, HIGH = np.array([0.02, 0.02, 0.03]), np.array([0.04, 0.04, 0.05])


@pytest.fixture(scope="module")
def search() -> HypothesisSearch:
    case = block_of_gel((6, 6, 6), (SIDE, SIDE, SIDE), axis=2, mu=1000.0)
    centres = case.mesh.centres
    solid = ~((centres > LOW) & (centres < HIGH)).all(axis=1)
    nodes, corners = np.unique(case.mesh.tetrahedra[solid], return_inverse=True)
    points = case.mesh.points[nodes]
    hollow = TetMesh(points, corners.reshape(-1, 4), node_sets={"foot": np.abs(points[:, 2]) < 1e-9})
    case = replace(case, mesh=hollow)
    pull = Traction(centre=(0.03, 0.03, HIGH[2]), value=(0.0, 0.0, 1500.0), radius=0.012)
    model = model_of(replace(case, mechanisms=(pull,)))
    u = EquilibriumSolver(System(model, "cpu")).solve(model.external_forces()).u
    rng = np.random.default_rng(0)
    at = points[rng.choice(len(points), POINTS, replace=False)]
    return screened(with_beads(case, u, at, NOISE, rng), "cpu", mesh_error=False, mechanisms=["traction"])


def placements(search: HypothesisSearch) -> tuple[dict[str, WeightedSet], str, str]:
    """The traction by its surface, and the names of the wall and of the outer surface."""
    best = search.get(("traction",))
    assert best is not None
    by_surface = {each.effects[0].surface: each for each in (best, *best.alternatives)}
    [wall] = [surface for surface in by_surface if "outer" not in surface]
    [outer] = [surface for surface in by_surface if "outer" in surface]
    return by_surface, wall, outer


def test_what_an_unlikely_place_gains_is_no_gain_of_all(search: HypothesisSearch) -> None:
    best = search.get(("traction",))
    assert best is not None
    [other] = best.alternatives
    known, gains = other.hypothesis.log_evidence, []
    for log_share in (0.0, -30.0):
        here = replace(other, refined=False, log_share=log_share)
        refined = with_refined_places(search.base, here, search.spacing, search.base.effects)
        gains.append(refined.hypothesis.log_evidence - known)
    assert abs(gains[0]) > 0.1
    assert abs(gains[1]) < 1e-9


@pytest.mark.parametrize("share", [0.4, 0.1, 1e-9])
def test_placements_that_lose_nothing_by_fits_have_the_evidence_that_they_had(share: float, search: HypothesisSearch):
    best = search.get(("traction",))
    assert best is not None
    fitted = search._fitted(replace(best, alternatives=()))
    known = [replace(fitted, log_share=np.log(part)) for part in (1.0 - share, share)]
    chosen = best_of_placements(known, known)
    np.testing.assert_allclose(chosen.hypothesis.log_evidence, fitted.hypothesis.log_evidence, atol=1e-9)
    np.testing.assert_allclose(chosen.log_share, np.log(1.0 - share), atol=1e-9)
    # where the likeliest loses nearly all, what is left is the share of the other one
    lost = [known[0].with_evidence(fitted.hypothesis.log_evidence - 100.0), known[1]]
    chosen = best_of_placements(lost, known)
    expected = fitted.hypothesis.log_evidence + np.log(share)
    np.testing.assert_allclose([chosen.hypothesis.log_evidence, chosen.log_share], [expected, 0.0], atol=1e-6)


def test_a_far_place_does_not_stand_for_all_where_the_fit_of_the_best_has_lost(search: HypothesisSearch) -> None:
    """The sum over all places is the same for each of them: what acts beside a far one would gain all of its loss."""
    names = ("traction",)
    by_surface, wall, outer = placements(search)
    fitted = search._fitted(replace(by_surface[wall], alternatives=()))
    lost = fitted.with_evidence(by_surface[outer].hypothesis.log_evidence - 3.0)
    far = replace(by_surface[outer], alternatives=(), log_share=-20.0)
    kept = copy.copy(search)
    kept._sets = {**search._sets, fitted.names: replace(lost, log_share=0.0, alternatives=(far,))}
    kept._move(kept._sets[fitted.names])
    moved = kept.get(names)
    assert moved is not None
    assert moved.moved
    assert moved.effects[0].surface == wall
    np.testing.assert_allclose(moved.hypothesis.log_evidence, lost.hypothesis.log_evidence, atol=0.1)


@pytest.mark.slow(8)
def test_each_surface_has_a_fit_of_its_own(search: HypothesisSearch) -> None:
    names = ("traction",)
    by_surface, wall, outer = placements(search)
    assert len(by_surface) == 2
    alternatives = (replace(by_surface[wall], alternatives=()),)
    search._sets[frozenset(names)] = replace(by_surface[outer], alternatives=alternatives)
    search.fit()
    fitted = search.get(names)
    assert fitted is not None
    assert fitted.refit is not None
    assert fitted.moved
    assert fitted.effects[0].surface == wall
    assert np.linalg.norm(fitted.effects[0].proposed.centre - np.array([0.03, 0.03, HIGH[2]])) < 0.01
