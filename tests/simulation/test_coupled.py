"""Two terms with unknowns of their own at once: two fluids in one skeleton, beside Biot's equations in dense NumPy.

Tully and Ventikos (2011, J. Fluid Mech. 667, 188) describe the brain by several fluids that share one skeleton.
"""

import numpy as np
import pytest
from bodies import model_of
from shapes import cube, distorted

from warpbrain.arrays import Floats
from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.mechanisms.drainage import Drainage, DrainageTerm
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.simulation.equilibrium import EquilibriumOptions
from warpbrain.simulation.factors import KeptFactors
from warpbrain.simulation.model import Material, Model
from warpbrain.simulation.quasi_static import follow_slowly
from warpbrain.simulation.system import System

MU, POISSON = 1000.0, 0.4
TIMES = (0.01, 0.1, 1.0, 5.0)
EVERYWHERE = Drainage(permeability=2e-5, drained="top")
IN_HALF = Drainage(
    permeability=1e-4, storage=1e-5, drained="wall", elements="half", exchange=1e-4, capillary_pressure=2e-5
)


def mesh_with_sets() -> TetMesh:
    mesh = distorted(cube(3), 0.03)
    x, _, z = cube(3).points.T
    half = mesh.points[mesh.tetrahedra].mean(axis=1)[:, 0] < 0.5
    return TetMesh(mesh.points, mesh.tetrahedra, None, {"top": z == 1.0, "wall": x == 0.0}, {"half": half})


def body(density: float, fluids: tuple[Drainage, ...] = (EVERYWHERE, IN_HALF)) -> Model:
    """A block that stands on its base and sinks aside under its weight."""
    held = np.repeat((cube(3).points[:, 2] == 0.0)[:, None], 3, axis=1)
    weight = Gravity(direction=(0.4, 0.0, -1.0), density=density)
    material = Material(NeoHookean(MU), POISSON)
    return model_of(mesh_with_sets(), material, constrained=held, loads=[weight], mechanisms=fluids)


def solution(system: System, factors: KeptFactors | None = None) -> Floats:
    """Of the system's matrix and load."""
    solver = system.linear_solver(tolerance=1e-10, max_iterations=5000, watch_curvature=True, factors=factors)
    solver.prepare()
    system.solution.zero_()
    solver.solve()
    assert solver.result().converged
    return system.solution.numpy().copy()


def linear_course(model: Model) -> list[Floats]:
    """Displacement and the pressure of each fluid at `TIMES`: small strains, backward Euler, every matrix dense."""
    mesh, n = model.mesh, len(model.mesh.points)
    lam = 2.0 * MU * POISSON / (1.0 - 2.0 * POISSON)
    K, size = np.zeros((3 * n, 3 * n)), 3 * n
    fluids = list(model.mechanisms)
    B, rate, flow = (np.zeros((len(fluids), n, width)) for width in (size, n, n))
    source = np.zeros((len(fluids), n))
    for nodes, volume, number in zip(mesh.tetrahedra, mesh.volumes, range(len(mesh.volumes)), strict=True):
        g = np.linalg.inv(np.column_stack([np.ones(4), mesh.points[nodes]]))[1:].T
        every = (3 * nodes[:, None] + np.arange(3)).ravel()
        # of displacement component i at node a: e = (e_i (x) g_a + g_a (x) e_i) / 2
        E = np.zeros((12, 3, 3))
        for a in range(4):
            for i in range(3):
                E[3 * a + i, i] += 0.5 * g[a]
                E[3 * a + i, :, i] += 0.5 * g[a]
        trace = np.trace(E, axis1=1, axis2=2)
        K[np.ix_(every, every)] += volume * (2.0 * MU * np.einsum("pij,qij->pq", E, E) + lam * np.outer(trace, trace))
        mass = volume * (np.ones((4, 4)) + np.eye(4)) / 20.0
        for f, fluid in enumerate(fluids):
            if fluid.elements and not mesh.element_sets[fluid.elements][number]:
                continue
            pairs = np.ix_(nodes, nodes)
            B[f][np.ix_(nodes, every)] += volume / 4.0 * trace
            rate[f][pairs] += fluid.storage * mass + (mass - volume / 16.0) / (2.0 * MU)
            flow[f][pairs] += volume * fluid.permeability * g @ g.T + fluid.exchange * mass
            source[f][nodes] += fluid.exchange * fluid.capillary_pressure * volume / 4.0
    free = np.flatnonzero(~model.constrained.ravel())
    closed = [
        np.flatnonzero(rate[f].diagonal().astype(bool) & ~fluid.open_nodes(mesh)) for f, fluid in enumerate(fluids)
    ]
    starts = np.cumsum([len(free), *map(len, closed)])
    external = model.external_forces().ravel()
    u, p, before, course = np.zeros(size), np.zeros((len(fluids), n)), 0.0, []
    for time in TIMES:
        h, before = time - before, time
        matrix, right = np.zeros((starts[-1], starts[-1])), np.zeros(starts[-1])
        matrix[: starts[0], : starts[0]], right[: starts[0]] = K[np.ix_(free, free)], external[free]
        for f, nodes in enumerate(closed):
            rows = slice(starts[f], starts[f + 1])
            coupling = B[f][np.ix_(nodes, free)]
            matrix[: starts[0], rows], matrix[rows, : starts[0]] = -coupling.T, coupling
            matrix[rows, rows] = (rate[f] + h * flow[f])[np.ix_(nodes, nodes)]
            right[rows] = (B[f] @ u + rate[f] @ p[f] + h * source[f])[nodes]
        x = np.linalg.solve(matrix, right)
        u = np.zeros(size)
        u[free] = x[: starts[0]]
        for f, nodes in enumerate(closed):
            p[f][nodes] = x[starts[f] : starts[f + 1]]
        course.append(np.concatenate([u, p.ravel()]))
    return course


@pytest.mark.parametrize("factors", [None, KeptFactors()], ids=["own factors", "kept factors"])
def test_two_fluids_are_those_of_biots_equations(factors: KeptFactors | None) -> None:
    model = body(3e-6)
    system = System(model, "cpu")
    fluids = [term for term in system.terms if isinstance(term, DrainageTerm)]
    moments = follow_slowly(system, TIMES, EquilibriumOptions(tolerance=1e-9), factors=factors)
    size = 3 * system.size
    for moment, expected in zip(moments, linear_course(model), strict=True):
        displacement = moment.state.u.ravel()
        np.testing.assert_allclose(displacement, expected[:size], rtol=0, atol=1e-6 * np.abs(expected[:size]).max())
        pressures = np.concatenate([fluid.pressures() for fluid in fluids])
        np.testing.assert_allclose(pressures, expected[size:], rtol=0, atol=1e-5 * np.abs(expected[size:]).max())


def test_the_solution_leaves_nothing_of_a_large_deformation() -> None:
    """`K d + sum_f B_f^T A_f^-1 B_f d` from differences of the forces themselves, as each pressure follows."""
    system = System(body(30.0), "cpu")
    system.set_time_step(0.3)
    free = ~system.model.constrained
    u = 0.02 * system.model.mesh.points[:, [2, 0, 1]] * free
    system.u.assign(u)
    system.evaluate_tangents()
    system.assemble(1.0, 0.0)
    load = np.random.default_rng(3).normal(size=(system.size, 3)) * free
    system.load.assign(load)
    along_load = solution(system)
    step = 1e-5 / np.abs(along_load).max()
    forces = []
    for sign in (-1.0, 1.0):
        system.u.assign(u + sign * step * along_load)
        forces.append(system.internal_forces())
    along = (forces[1] - forces[0]) / (2.0 * step)
    assert np.linalg.norm((along - load)[free]) < 1e-5 * np.linalg.norm(load)


def test_a_fluid_that_is_steady_leaves_the_other_alone() -> None:
    """Where no term's unknowns follow the displacement the solver is that of the skeleton."""
    system = System(body(30.0), "cpu")
    system.set_time_step(np.inf)
    system.evaluate_tangents()
    system.assemble(1.0, 0.0)
    system.load.assign(np.ones((system.size, 3)) * ~system.model.constrained)
    displacement = solution(system)
    dense = system.stiffness().toarray()
    free = ~system.model.constrained.ravel()
    expected = np.linalg.solve(dense[np.ix_(free, free)], np.ones(free.sum()))
    np.testing.assert_allclose(displacement.ravel()[free], expected, rtol=0, atol=1e-8 * np.abs(expected).max())
