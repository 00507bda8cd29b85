"""A soft cantilever that sags by half its length under its weight, of which its case says nothing."""

from dataclasses import replace

import numpy as np
import pytest
from drawn_for_commit import one_for_this_commit
from gel import block_of_gel, with_beads

from warpbrain.diagnosis.diagnose import diagnose
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.simulation.equilibrium import EquilibriumSolver
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System
from warpbrain.worlds.options import DiagnosisOptions

#: Length and height of the beam, noise [m]; tracked points.
LENGTH, HEIGHT, NOISE, POINTS = 0.1, 0.03, 2e-4, 45


@pytest.mark.slow(30)
@pytest.mark.parametrize("mesh_error", one_for_this_commit([False, True]))
def test_its_weight_is_found(mesh_error: bool) -> None:
    """With the mesh taken for exact, and with its error as it is found."""
    sides = LENGTH, HEIGHT, HEIGHT
    case = block_of_gel((10, 3, 3), sides, axis=0, mu=5000.0, gravity_axis=(0.0, 0.0, -1.0))
    weight = Gravity(direction=(0.0, 0.0, -1.0), density=1000.0)
    model = model_of(replace(case, mechanisms=(weight,)))
    u = EquilibriumSolver(System(model, "cpu")).solve(model.external_forces()).u
    assert -u[:, 2].min() > 0.5 * LENGTH
    rng = np.random.default_rng(0)
    x = np.array([LENGTH, HEIGHT, HEIGHT]) * rng.uniform(0.03, 0.97, (POINTS, 3))
    found = diagnose(with_beads(case, u, x, NOISE, rng), DiagnosisOptions(mesh_error=mesh_error), "cpu")
    assert found.decision.causes == ("gravity",)
