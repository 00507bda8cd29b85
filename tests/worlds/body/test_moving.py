"""A traction that moves a face by a third of its radius: its fit tells where it is, the model about rest does not."""

from dataclasses import replace

import numpy as np
import pytest
from equilibria_elsewhere import assert_columns_are_differences
from gel import block_of_gel, with_beads

from warpbrain.physics.mechanisms.traction import Traction
from warpbrain.simulation.equilibrium import EquilibriumSolver
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System
from warpbrain.worlds.body.fitting import Fitter
from warpbrain.worlds.body.hypotheses import HypothesisSearch, screened
from warpbrain.worlds.body.moving import moved_about_fit
from warpbrain.worlds.body.places import PlaceCoordinates
from warpbrain.worlds.body.weighted_set import WeightedSet

#: Edge, noise, and centre of the patch [m]; tracked points.
SIDE, NOISE, CENTRE, POINTS = 0.06, 1e-4, np.array([0.02, 0.034, 0.06]), 60


@pytest.fixture(scope="module")
def search() -> HypothesisSearch:
    case = block_of_gel((6, 6, 6), (SIDE, SIDE, SIDE), axis=2, mu=1000.0)
    x, y, z = CENTRE.tolist()
    pull = Traction(centre=(x, y, z), value=(150.0, 0.0, 1200.0), radius=0.02)
    model = model_of(replace(case, mechanisms=(pull,)))
    u = EquilibriumSolver(System(model, "cpu")).solve(model.external_forces()).u
    assert np.linalg.norm(u, axis=1).max() > 6e-3
    rng = np.random.default_rng(0)
    at = SIDE * rng.uniform(0.05, 1.0, (POINTS, 3))
    found = screened(with_beads(case, u, at, NOISE, rng), "cpu", mesh_error=False, mechanisms=["traction"])
    found.fit(alone=True)
    return found


def fitted_at(search: HypothesisSearch, centre: np.ndarray) -> WeightedSet:
    """The set with the traction, fitted with that somewhere."""
    candidate = search.get(("traction",))
    assert candidate is not None
    elsewhere = candidate.effects[0].proposed.elsewhere
    assert elsewhere is not None
    effects = tuple(search.base.effects.of([elsewhere(centre, 0.02)]))
    q = candidate.columns.shape[1] - effects[0].columns.shape[1]
    columns = np.column_stack([candidate.columns[:, :q], effects[0].columns])
    refit = Fitter(search.base).fit(effects, columns, [np.zeros(columns.shape[1])], candidate.marginal)
    return replace(
        candidate, effects=effects, residual=refit.linear, columns=refit.columns, marginal=refit.marginal, refit=refit
    )


@pytest.mark.slow(6)
def test_what_was_fitted_off_its_place_is_moved_nearer_to_it(search: HypothesisSearch) -> None:
    off = fitted_at(search, CENTRE + np.array([0.006, 0.0, 0.0]))
    assert off.refit is not None
    moved = moved_about_fit(search.base, Fitter(search.base), off, search.spacing)
    assert moved.refit is not None
    gain = moved.refit.log_evidence - off.refit.log_evidence
    assert gain > 5.0
    assert moved.hypothesis.log_evidence - off.hypothesis.log_evidence == pytest.approx(gain, abs=0.1)
    before, after = (np.linalg.norm(found.effects[0].proposed.centre - CENTRE) for found in (off, moved))
    assert after < 0.8 * before
    effects, weights = moved.places[0].spread(moved.effects[0])
    apart = np.array([np.linalg.norm(effect.proposed.centre - moved.effects[0].proposed.centre) for effect in effects])
    assert after < 3.0 * np.sqrt(weights @ apart**2)


def test_what_was_fitted_at_its_place_stays(search: HypothesisSearch) -> None:
    there = fitted_at(search, CENTRE)
    assert there.refit is not None
    moved = moved_about_fit(search.base, Fitter(search.base), there, search.spacing)
    assert moved.refit is not None
    assert moved.refit.log_evidence - there.refit.log_evidence < 5.0
    assert np.linalg.norm(moved.effects[0].proposed.centre - CENTRE) < 0.25 * search.spacing


def test_what_is_linear_about_a_fit_is_so_in_the_place(search: HypothesisSearch) -> None:
    base, (effect,) = search.base, search.get(("traction",)).effects
    place = PlaceCoordinates(base.at.system.model, effect.proposed, 0.5 * search.spacing)
    assert_columns_are_differences(base, place, effect, np.array([0.1, 0.0, 0.8]))
