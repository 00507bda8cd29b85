"""What a small force does to the sensors, and where the map finds it."""

import numpy as np
import pytest

from warpbrain.diagnosis.locating import score_map
from warpbrain.diagnosis.result import Diagnosis
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.worlds.body.unknown import force_patches

#: Length of patches, and distance between them [m].
LENGTH, SPACING = 0.012, 0.016


def test_sensors_answer_a_force_as_equilibria_do(small_diagnosis: Diagnosis) -> None:
    at = small_diagnosis.base.at
    model = at.system.model
    force = 1e-6 * np.random.default_rng(0).normal(size=at.u.shape)
    options = EquilibriumOptions(tolerance=1e-12, cg_tolerance=1e-3)
    ends = [EquilibriumSolver(at.system, options).solve(model.external_forces() + s * force, at.u).u for s in (-1, 1)]
    moved = at.sensors.by_displacement @ ((ends[1] - ends[0]) / 2.0).ravel()
    answered = at.answers(force[None])[:, 0]
    assert np.abs(answered - moved).max() <= 1e-5 * np.abs(moved).max()


@pytest.mark.parametrize("number", range(0, 40, 5))
def test_a_single_source_is_found_where_it_is(number: int, small_diagnosis: Diagnosis) -> None:
    base = small_diagnosis.base
    sites, answers = force_patches(base.at, LENGTH, SPACING)
    if not np.linalg.norm(base.model.standardised(answers[:, number])) > 1e-6:
        pytest.skip("all of it is held")
    direction = np.random.default_rng(number).normal(size=3)
    residual = 1e-2 * answers[:, number] @ direction
    found = score_map(base.at, base.model, residual, 50, np.random.default_rng(1), LENGTH, SPACING)
    np.testing.assert_array_equal(found.sites[found.best], sites[number])
    assert np.all(found.scores <= found.scores[number] * (1.0 + 1e-9))
