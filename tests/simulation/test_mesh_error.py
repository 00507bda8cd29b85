"""The estimate of the error of the mesh beside the error itself, where a converged solution is known.

Estimate over error, at the tip of Cook's membrane with 8 elements a side: 0.996 at nu = 0.45, 0.993 at 0.49, and 0.949
for averaged elements; at the inner radius of a thick sphere, 3, 4 and 6 elements through the wall: 0.87, 0.80, 0.91.
"""

from dataclasses import replace

import numpy as np
import pytest
from bodies import model_of
from folders import write_folder
from shapes import box, swept, triangle

import warpbrain
from warpbrain.cases.boundary import Forced
from warpbrain.mesh import TetMesh, boundary_faces
from warpbrain.mesh.refinement import refined
from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.mechanisms.pressure import Pressure
from warpbrain.simulation.dynamics import Simulator
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver, solve_equilibrium
from warpbrain.simulation.mesh_error import FinerCase, GivenForces, estimate, mesh_error, prolongation
from warpbrain.simulation.model import Material
from warpbrain.simulation.result import NodalState, result_of
from warpbrain.simulation.system import System

#: Tip of Cook's membrane [mm]: P2-P1 elements by DOLFINx, 32 a side (tests/verification).
TRUTH = {0.45: 12.737, 0.49: 12.111}


def membrane(n: int) -> TetMesh:
    mesh = box((n, n, 1), (48.0, 44.0, 1.0))
    x, y, z = mesh.points.T
    low, high = 44.0 / 48.0 * x, 44.0 + 16.0 / 48.0 * x
    return replace(mesh, points=np.stack([x, (1.0 - y / 44.0) * low + y / 44.0 * high, z], axis=1))


def bend(mesh: TetMesh, poisson: float, elements: str, start: np.ndarray | None = None) -> NodalState:
    """Under 1 N spread over the right edge."""
    constrained = np.zeros(mesh.points.shape, dtype=bool)
    constrained[:, 2] = True
    constrained[mesh.points[:, 0] < 1e-9] = True
    faces = boundary_faces(mesh.tetrahedra)
    right = faces[np.all(mesh.points[faces][:, :, 0] > 48.0 - 1e-9, axis=1)]
    corners = mesh.points[right]
    areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    force = np.zeros(mesh.points.shape)
    np.add.at(force[:, 1], right.ravel(), np.repeat(areas / 16.0 / 3.0, 3))
    material = Material(NeoHookean(0.4225), poisson, "uncoupled")
    system = System(model_of(mesh, material, constrained=constrained, elements=elements), "cpu")
    step = 0.2 if start is None else 1.0
    solver = EquilibriumSolver(system, EquilibriumOptions(tolerance=1e-6, max_load_step=step))
    found = solver.solve(external=force, start=start)
    return NodalState(mesh, found.u, np.where(constrained, found.internal, 0.0))


@pytest.mark.parametrize(("poisson", "elements"), [(0.45, "tet4"), (0.49, "tet4"), (0.49, "tet4-averaged")])
def test_cook(poisson: float, elements: str) -> None:
    """The plain tip is 36 % and 53 % too low; most of that locks."""
    mesh = membrane(8)
    finer, ends = refined(mesh)
    state = bend(mesh, poisson, elements)

    def solve(other: str, small: bool, start: np.ndarray) -> NodalState:
        return bend(finer if small else mesh, poisson, other, start)

    found = estimate(state, elements, solve, prolongation(ends, len(mesh.points)))
    tip = int(np.argmin(np.linalg.norm(mesh.points - [48.0, 52.0, 1.0], axis=1)))
    error = TRUTH[poisson] - state.u[tip, 1]
    # what one finer mesh does not show: 5.1 %, 0.4 % and 0.7 % too small
    assert 0.93 < found.u[tip, 1] / error < 1.02
    if elements == "tet4":
        assert 0.7 < found.locking_share < 0.95
    else:
        assert not found.locking.any() and found.locking_share == 0.0


def octant(n: int) -> TetMesh:
    """Of a thick sphere, radii 1 and 2."""

    def place(xy: np.ndarray, s: np.ndarray) -> np.ndarray:
        direction = np.stack([xy[:, 0], xy[:, 1], 1.0 - xy.sum(axis=1)], axis=1)
        return 2.0 ** s[:, None] * direction / np.linalg.norm(direction, axis=1)[:, None]

    mesh = swept(triangle(n), n, place)
    return replace(mesh, node_sets={"inner": np.linalg.norm(mesh.points, axis=1) < 1.0 + 1e-9})


@pytest.mark.parametrize("n", [3, 4])
def test_thick_sphere(n: int) -> None:
    """A live pressure of 100 Pa at nu = 0.45; the refined mesh keeps the facets, so of the shape nothing is learnt.

    The truth is that of the same facets: extrapolated from two more refinements of averaged elements.
    """
    material = Material(NeoHookean(1000.0), 0.45, "uncoupled")

    def inflate(mesh: TetMesh, elements: str) -> NodalState:
        constrained = np.abs(mesh.points) < 1e-9
        acting = [Pressure(nodes="inner", value=100.0)]
        model = model_of(mesh, material, constrained=constrained, mechanisms=acting, elements=elements)
        found = solve_equilibrium(System(model, "cpu"), EquilibriumOptions(tolerance=1e-6))
        return NodalState(mesh, found.u, found.u)

    mesh = octant(n)
    finer, ends = refined(mesh)

    def solve(other: str, small: bool, start: np.ndarray) -> NodalState:
        return inflate(finer if small else mesh, other)

    state = inflate(mesh, "tet4")
    found = estimate(state, "tet4", solve, prolongation(ends, len(mesh.points)))
    inner = mesh.node_sets["inner"]
    one, two = refined(finer)[0], finer
    levels = [inflate(m, "tet4-averaged").u[: len(mesh.points)] for m in (two, one)]
    truth = (4.0 * levels[1] - levels[0]) / 3.0

    def radial(u: np.ndarray) -> float:
        return float(np.mean(np.sum(u[inner] * mesh.points[inner], axis=1)))

    # truth is extrapolated from two finer meshes, the estimate from one: 20 % and 13 % too small
    assert 0.75 < radial(found.u) / (radial(truth) - radial(state.u)) < 1.0


# -- cases ------------------------------------------------------------------------------------------------------------


def test_a_finer_case_has_the_same_resultants(tmp_path) -> None:
    """Whatever kind of load: shared forces become those of a load on the surface."""
    case = warpbrain.read_case(write_folder(tmp_path))
    force = Forced(name="push", nodes="top", total=(0.01, 0.0, -0.03), mass=0.02)
    case = replace(case, boundaries=(*case.boundaries[:1], force))
    model = warpbrain.model_of(case)
    finer = FinerCase(case).model(model)
    assert len(finer.mesh.tetrahedra) == 8 * len(model.mesh.tetrahedra)
    np.testing.assert_allclose(finer.external_forces().sum(axis=0), model.external_forces().sum(axis=0), atol=1e-12)
    np.testing.assert_allclose(finer.external_forces().sum(axis=0), force.total, atol=1e-12)
    assert finer.node_masses.sum() == pytest.approx(model.node_masses.sum()) == pytest.approx(model.mass + 0.02)


@pytest.mark.parametrize("poisson", [0.45, 0.49])
def test_a_block_of_48_elements(tmp_path, poisson: float) -> None:
    """A case under a shared force, whose error is as large as its displacement; truth from 384 and 3,072 elements.

    Estimate over error, root mean squares: 1.13 and 1.07; beside truth from 3,072 and 24,576 elements 1.16 and 1.09.
    """
    case = replace(warpbrain.read_case(write_folder(tmp_path)), poisson=poisson)
    model = warpbrain.model_of(case)
    system = System(model, "cpu")
    solve_equilibrium(system)
    result = result_of(system)
    found = mesh_error(case, model, result, device="cpu")
    finer, forces, levels = case, model.external_forces(), []
    for _ in range(2):
        refined_case = FinerCase(finer)
        finer, forces = refined_case.case, refined_case.spread(forces)
        loads = [GivenForces(forces=forces, masses=np.zeros(len(forces)))]
        small = replace(warpbrain.model_of(finer), loads=loads, elements="tet4-averaged")
        levels.append(solve_equilibrium(System(small, "cpu"), EquilibriumOptions(tolerance=1e-6)).u[: len(result.u)])
    error = levels[1] + (levels[1] - levels[0]) / 3.0 - result.u
    assert np.linalg.norm(error) > 0.8 * np.linalg.norm(result.u)
    assert 0.9 < np.linalg.norm(found.u) / np.linalg.norm(error) < 1.2
    # not only as large: the same vectors, to 18 % and 22 %, which is the error of an estimate from meshes this coarse
    assert np.linalg.norm(found.u - error) < 0.25 * np.linalg.norm(error)


@pytest.mark.parametrize("steps", [None, 3])
def test_of_a_case_it_is_the_difference_of_two_runs(tmp_path, steps: int | None) -> None:
    """An equilibrium and a motion: locking is what averaged elements change."""
    case = warpbrain.read_case(write_folder(tmp_path))
    states = {}
    for elements in ("tet4", "tet4-averaged"):
        model = replace(warpbrain.model_of(case), elements=elements)
        system = System(model, "cpu")
        if steps is None:
            solve_equilibrium(system)
            time = np.inf
        else:
            simulator = Simulator(system)
            for step in range(1, steps + 1):
                simulator.prescribe(model.prescribed_at(simulator.time + 1e-3, step / steps))
                simulator.step()
            time = simulator.time
        states[elements] = model, result_of(system, time)
    model, result = states["tet4"]
    found = mesh_error(case, model, result, smaller=False, steps=steps, device="cpu")
    expected = states["tet4-averaged"][1]
    assert found.size is None and np.abs(found.u).max() > 0.0
    np.testing.assert_allclose(found.u, expected.u - result.u, atol=1e-4 * np.abs(result.u).max())
    np.testing.assert_allclose(
        found.reactions, expected.reactions - result.reactions, atol=1e-3 * np.abs(result.reactions).max()
    )
