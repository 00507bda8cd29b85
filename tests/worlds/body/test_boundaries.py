"""What is held ends elsewhere, and nodes do not share a force evenly: beside equilibria of which that is so."""

from dataclasses import replace

import numpy as np
import pytest
from gel import block_of_gel

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.cases.boundary import Fixed
from warpbrain.cases.case import Case
from warpbrain.inference.beliefs import belief
from warpbrain.mesh.surface import node_areas
from warpbrain.physics.load import NodalForce
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.model import Model
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System
from warpbrain.worlds.body.boundaries import border_of, boundary_columns, visible_modes
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.sensors import tracked_points

SIDE, CELLS = 0.06, (6, 6, 4)
#: So small that all is linear.
FORCE = (2e-5, 0.0, -4e-5)


@pytest.fixture(scope="module")
def case() -> Case:
    """A block that is held on a half of its foot, which ends within a face."""
    case = block_of_gel(CELLS, (SIDE, SIDE, SIDE), axis=2, mu=1000.0)
    x, z = case.mesh.points[:, 0], case.mesh.points[:, 2]
    half = case.mesh.node_sets["foot"] & (x < 0.5 * SIDE + 1e-9)
    top = (z > SIDE - 1e-9) & (x > 0.25 * SIDE)
    mesh = case.mesh.with_node_sets({**case.mesh.node_sets, "half": half, "top": top})
    return replace(case, mesh=mesh, boundaries=(Fixed(name="half", nodes="half"),))


@pytest.fixture(scope="module")
def model(case: Case) -> Model:
    return replace(model_of(case), loads=[NodalForce(nodes="top", total=FORCE)])


def solved(model: Model, forces: Floats | None = None) -> tuple[System, Floats, Floats]:
    """System, displacement [m] and reactions [N] under the loads, and under further forces (N, 3)."""
    system, external = System(model, "cpu"), model.external_forces()
    if forces is not None:
        external = external + forces
    solution = EquilibriumSolver(system, EquilibriumOptions(tolerance=1e-9)).solve(external)
    return system, solution.u, model.reactions(solution.internal, external)


@pytest.fixture(scope="module")
def at(model: Model) -> Linearisation:
    return linear(model)


def linear(model: Model) -> Linearisation:
    """About the state, as points within the body see it."""
    system, u, reactions = solved(model)
    points = SIDE * np.random.default_rng(0).uniform(0.1, 0.9, (20, 3))
    return Linearisation(system, u, reactions, tracked_points(model.mesh, points, points.mean(axis=0)))


def in_all_components(held: Bools) -> Bools:
    """Of nodes (N,): (N, 3)."""
    return np.repeat(held[:, None], 3, axis=1)


def moved_by(model: Model, held: Bools, motion: tuple[float, ...]) -> Model:
    """The same with these nodes (N,) moved [m], and no other held."""
    constrained = in_all_components(held)
    return replace(model, constrained=constrained, prescribed=constrained * np.array(motion))


def change_of(at: Linearisation, other: Model, forces: Floats | None = None) -> Floats:
    """What the sensors see where other nodes are held, or more acts on nodes (N, 3)."""
    return np.asarray(at.sensors.by_displacement @ (solved(other, forces)[1] - at.u).ravel())


def test_the_border_of_what_is_held_lies_within_a_face(case: Case) -> None:
    mesh, x = case.mesh, case.mesh.points[:, 0]
    foot = mesh.node_sets["foot"]
    border = border_of(mesh, in_all_components(mesh.node_sets["half"]))
    np.testing.assert_array_equal(border.held, np.flatnonzero(foot & (np.abs(x - 0.5 * SIDE) < 1e-9)))
    assert foot[border.free].all()
    np.testing.assert_allclose(x[border.free], SIDE * (0.5 + 1.0 / CELLS[0]))
    np.testing.assert_allclose(border.mean_of_held @ x, 0.5 * SIDE)
    # what slides along a plane is neither held nor free
    sliding = in_all_components(mesh.node_sets["half"])
    sliding[border.free[0], 0] = True
    np.testing.assert_array_equal(border_of(mesh, sliding).free, border.free[1:])


def test_what_is_held_up_to_the_edges_of_a_body_ends_there(case: Case) -> None:
    border = border_of(case.mesh, in_all_components(case.mesh.node_sets["foot"]))
    assert not len(border.held) and not len(border.free)


@pytest.mark.parametrize("moved", [(0.0, 0.0, 0.0), (2e-7, 0.0, -1e-7)])
def test_nodes_are_released_and_held_as_in_an_equilibrium(moved: tuple[float, ...], model: Model) -> None:
    held = model.constrained.all(axis=1)
    at = linear(moved_by(model, held, moved))
    border = border_of(model.mesh, model.constrained)
    count = len(border.held)
    found = boundary_columns(at) / belief("mesh.held_edge")
    for number in (0, count // 2, count, count + len(border.free) // 2):
        other, node = held.copy(), [*border.held, *border.free][number]
        other[node] = ~other[node]
        expected = change_of(at, moved_by(model, other, moved))
        np.testing.assert_allclose(found[:, number], expected, atol=2e-3 * np.abs(expected).max())


def test_a_force_is_shared_unevenly_and_as_large_as_before(at: Linearisation, model: Model) -> None:
    top = np.flatnonzero(model.mesh.node_sets["top"])
    found = boundary_columns(at)[:, -len(top) :] / belief("loads.share")
    expected = change_of(at, model, shared(top, np.eye(len(top))[3] - 1.0 / len(top), len(at.u)))
    np.testing.assert_allclose(found[:, 3], expected, atol=2e-3 * np.abs(expected).max())
    np.testing.assert_allclose(found.sum(axis=1), 0.0, atol=1e-9 * np.abs(found).max())


def test_a_force_is_shared_by_areas(at: Linearisation, model: Model) -> None:
    top = np.flatnonzero(model.mesh.node_sets["top"])
    areas = node_areas(model.mesh.points, model.mesh.boundary)[top]
    assert areas.max() > 1.2 * areas.min()
    found = boundary_columns(at)[:, -len(top) - 1] / belief("loads.by_area")
    expected = change_of(at, model, shared(top, areas / areas.mean() - 1.0, len(at.u)))
    np.testing.assert_allclose(found, expected, atol=2e-3 * np.abs(expected).max())


def shared(nodes: Ints, more: Floats, count: int) -> Floats:
    """Further forces (count, 3) [N] of nodes (k,) that take of the load by so much more (k,) than an even share."""
    forces = np.zeros((count, 3))
    forces[nodes] = more[:, None] * np.array(FORCE) / len(nodes)
    return forces


def test_modes_that_are_kept_hold_the_variance(at: Linearisation) -> None:
    columns = boundary_columns(at)
    modes = visible_modes(columns)
    np.testing.assert_allclose(modes.T @ modes, np.eye(modes.shape[1]), atol=1e-12)
    left = np.linalg.norm(columns) ** 2 - np.linalg.norm(columns @ modes) ** 2
    assert 0.0 <= left <= belief("unknown.cut") * np.linalg.norm(columns) ** 2
    assert modes.shape[1] < columns.shape[1]
    assert visible_modes(np.zeros((5, 0))).shape == (0, 0)
    assert visible_modes(np.zeros((5, 3))).shape == (3, 0)
