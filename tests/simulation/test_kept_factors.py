"""Factors of a state near by, where fluid flows."""

import numpy as np
import pytest
from bodies import model_of
from shapes import cube

from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms.drainage import Drainage
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.simulation.equilibrium import EquilibriumOptions
from warpbrain.simulation.factors import KeptFactors
from warpbrain.simulation.model import Material, Model
from warpbrain.simulation.quasi_static import follow_slowly
from warpbrain.simulation.system import System

#: What gives way in time.
CAUSES: dict[str, Mechanism] = {
    "fluid": Drainage(permeability=2e-5, drained="top"),
    "fluid in a part": Drainage(permeability=1e-4, storage=1e-5, drained="wall", elements="half", exchange=1e-4),
}
TIMES = (0.01, 0.1, 1.0, 10.0)


def body(cause: Mechanism, modulus: float = 1000.0, stiffer: float = 3.0) -> Model:
    """A cube of two tissues, one some times as stiff, that stands on its base and is drawn aside and down."""
    mesh = cube(4)
    x, _, z = mesh.points.T
    half = mesh.points[mesh.tetrahedra].mean(axis=1)[:, 0] < 0.5
    mesh = TetMesh(
        mesh.points, mesh.tetrahedra, np.where(half, 1, 2).astype(np.int32), {"top": z == 1.0, "wall": x == 0.0},
        {"half": half},
    )  # fmt: skip
    weight = Gravity(direction=(0.4, 0.0, -1.0), density=30.0)
    return model_of(
        mesh, Material(NeoHookean(modulus), 0.45), Material(NeoHookean(stiffer * modulus), 0.45),
        constrained=np.repeat((z == 0.0)[:, None], 3, axis=1), loads=[weight], mechanisms=[cause],
    )  # fmt: skip


def at_a_step(cause: Mechanism, step: float, modulus: float = 1000.0, stiffer: float = 3.0) -> System:
    """Its system with a tangent in a step [s] and a right-hand side."""
    system = System(body(cause, modulus, stiffer), "cpu")
    system.set_time_step(step)
    system.u.assign(0.02 * system.model.mesh.points[:, [2, 0, 1]] * ~system.model.constrained)
    system.evaluate_tangents()
    system.assemble(1.0, 0.0)
    system.load.assign(np.random.default_rng(3).normal(size=(system.size, 3)) * ~system.model.constrained)
    return system


def solved(system: System, tolerance: float, factors: KeptFactors | None) -> tuple[np.ndarray, int]:
    """The solution, and in how many iterations."""
    solver = system.linear_solver(tolerance=tolerance, max_iterations=5000, watch_curvature=True, factors=factors)
    solver.prepare()
    system.solution.zero_()
    solver.solve(tolerance)
    assert solver.result().converged
    return system.solution.numpy().copy(), solver.result().iterations


def exact(system: System) -> np.ndarray:
    """The solution by a dense matrix, one product with the tangent a column."""
    free, size = ~system.model.constrained.ravel(), system.size
    load = system.load.numpy().ravel().copy()
    units = np.eye(3 * size)[free].reshape(-1, size, 3)
    K = np.column_stack([system.stiffness_times(unit).ravel()[free] for unit in units])
    system.load.assign(load.reshape(-1, 3))
    solution = np.zeros(3 * size)
    solution[free] = np.linalg.solve(K, load[free])
    return solution.reshape(-1, 3)


@pytest.mark.parametrize("step", [1e-3, 1.0])
@pytest.mark.parametrize("cause", list(CAUSES))
def test_the_solution_is_that_of_the_whole_tangent(cause: str, step: float) -> None:
    system = at_a_step(CAUSES[cause], step)
    expected = exact(system)
    for factors in (None, KeptFactors()):
        found, taken = solved(system, 1e-10, factors)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8 * np.abs(expected).max())
        assert taken < 40


@pytest.mark.parametrize("cause", list(CAUSES))
def test_factors_of_another_tissue_and_step_serve(cause: str) -> None:
    factors = KeptFactors()
    solved(at_a_step(CAUSES[cause], 0.1, 700.0), 1e-3, factors)
    kept = factors._factors
    system = at_a_step(CAUSES[cause], 1.0)
    expected = exact(system)
    found, few = solved(system, 1e-10, factors)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8 * np.abs(expected).max())
    assert factors._factors is kept and few < 40


def test_factors_that_waste_more_than_new_ones_cost_are_renewed() -> None:
    system, factors = at_a_step(CAUSES["fluid"], 1.0), KeptFactors()
    solved(at_a_step(CAUSES["fluid"], 1.0, stiffer=0.01), 1e-3, factors)
    counts = [solved(system, 1e-8, factors)[1] for _ in range(12)]
    # those of tissue of which the other half is the stiff one, then its own
    assert counts[-1] < counts[0] / 2


def test_factors_serve_where_the_same_is_held() -> None:
    system, factors = at_a_step(CAUSES["fluid"], 1.0), KeptFactors()
    free = ~system.model.constrained.ravel()
    assert not factors.serve(free)
    assert factors.renew(system.stiffness(), free) and factors.serve(free)
    fewer = free.copy()
    fewer[-3:] = False
    assert not factors.serve(fewer)


@pytest.mark.parametrize("cause", list(CAUSES))
def test_a_course_is_the_same(cause: str) -> None:
    options = EquilibriumOptions(tolerance=1e-9)
    system = System(body(CAUSES[cause]), "cpu")
    expected = [moment.state for moment in follow_slowly(system, TIMES, options)]
    found = [moment.state for moment in follow_slowly(system, TIMES, options, factors=KeptFactors())]
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one.u, other.u, rtol=0, atol=1e-6 * np.abs(other.u).max())
    # and it goes on giving way
    assert np.linalg.norm(found[-1].u - found[0].u) > 0.03 * np.linalg.norm(found[0].u)
