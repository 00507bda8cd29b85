"""Displacement within elements, beside fields of second order and the wall of a thick sphere under pressure."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import model_of
from scipy.sparse import csr_matrix
from shapes import cube, distorted, octant

from warpbrain.estimation.surplus import Surplus, rows_by_surplus
from warpbrain.mesh import TetMesh
from warpbrain.mesh.refinement import finer_mesh
from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.mechanisms.pressure import Pressure
from warpbrain.recordings.closest import closest_points
from warpbrain.simulation.equilibrium import EquilibriumOptions, solve_equilibrium
from warpbrain.simulation.model import Material
from warpbrain.simulation.system import System
from warpbrain.worlds.body.sensors import tracked_points

RANDOM = np.random.default_rng(3)
MESH = distorted(cube(2), 0.05)
SECOND, FIRST = RANDOM.normal(size=(3, 3, 3)), RANDOM.normal(size=(3, 3))


def quadratic(x: np.ndarray) -> np.ndarray:
    return np.einsum("ijk,nj,nk->ni", SECOND, x, x) + x @ FIRST.T


def test_a_field_of_second_order_is_whole_within_elements() -> None:
    finer, ends = finer_mesh(MESH)
    count, random = len(MESH.points), np.random.default_rng(0)
    corners = MESH.points[random.choice(MESH.tetrahedra, 60)]
    places = np.einsum("nc,nci->ni", random.dirichlet(np.ones(4), 60), corners)
    at_nodes, edges = quadratic(finer.points), ends[len(MESH.points) :]
    sensors = tracked_points(MESH, places, np.zeros(3))
    surplus = Surplus.of(edges, at_nodes)
    linear = sensors.answer(at_nodes[:count], np.zeros((count, 3)))
    expected = quadratic(places).ravel()
    assert np.abs(linear - expected).max() > 0.01
    np.testing.assert_allclose(linear + sensors.answer_within(surplus), expected, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(surplus.with_middles(at_nodes[:count]), at_nodes, rtol=0.0, atol=1e-14)
    halved = surplus.plus(surplus.times(-0.5))
    np.testing.assert_allclose(2.0 * sensors.answer_within(halved), sensors.answer_within(surplus), atol=1e-14)


def test_a_linear_field_has_none() -> None:
    finer, ends = finer_mesh(MESH)
    assert np.abs(Surplus.of(ends[len(MESH.points) :], finer.points @ FIRST.T).values).max() < 1e-14


def test_rows_that_are_counted_from_another_state_have_the_surplus_of_both() -> None:
    edges = finer_mesh(MESH)[1][len(MESH.points) :]
    sensors = tracked_points(MESH, RANDOM.uniform(0.02, 0.98, size=(5, 3)), np.zeros(3))
    states = RANDOM.normal(size=(1, 2, len(edges), 3))
    first, second = (sensors.answer_within(Surplus(edges, values)) for values in states[0])
    for before, expected in ((-1, second), (0, second - first)):
        rows = replace(sensors, after=np.full(len(sensors), 1), before=np.full(len(sensors), before))
        np.testing.assert_allclose(rows.answers_within_in_time(edges, states)[:, 0], expected, atol=1e-14)


@pytest.mark.parametrize("n", [3, 4])
def test_the_wall_of_a_hole_under_pressure(n: int, device: str, verify) -> None:
    """Of radius 1 in a sphere of radius 4: Lamé's solution (Timoshenko and Goodier 1970, section 136).

    The pressure is a thousandth of the modulus.
    """
    poisson, mu, pressure = 0.45, 1000.0, 1.0
    bulk = 2.0 * mu * (1.0 + poisson) / (3.0 * (1.0 - 2.0 * poisson))
    expected = pressure / (3.0 * bulk * 63.0) + pressure * 64.0 / (4.0 * mu * 63.0)
    mesh = octant(n, 8, lambda s: 4.0**s)
    mesh = mesh.with_node_sets({"inner": np.linalg.norm(mesh.points, axis=1) < 1.0 + 1e-9})
    finer, ends = finer_mesh(mesh)

    def displacement(of: TetMesh) -> np.ndarray:
        acts = [Pressure(nodes="inner", value=pressure)]
        material = Material(NeoHookean(mu), poisson, "uncoupled")
        model = model_of(of, material, constrained=of.points == 0.0, mechanisms=acts)
        return solve_equilibrium(System(model, device), EquilibriumOptions(tolerance=1e-8)).u

    u, finer_u = displacement(mesh), displacement(finer)
    count = len(mesh.points)
    corners = u + (finer_u[:count] - u) * 5.0 / 3.0
    wall = mesh.boundary[mesh.node_sets["inner"][mesh.boundary].all(axis=1)]
    places = np.abs(np.random.default_rng(3).normal(size=(500, 3))) + 0.05
    places /= np.linalg.norm(places, axis=1)[:, None]
    closest = closest_points(places, mesh.points, wall)
    weights = np.zeros((len(places), count, 3))
    for corner in range(3):
        weights[np.arange(500), wall[closest.face, corner]] = closest.weights[:, corner, None] * places
    rows, edges = csr_matrix(weights.reshape(500, -1)), ends[count:]
    linear = rows @ corners.ravel()
    within = rows_by_surplus(rows, edges) @ Surplus.of(edges, finer_u).values.ravel()
    error, without = (abs(float(radial.mean()) / expected - 1.0) for radial in (linear + within, linear))
    verify(
        f"displacement of the wall of a hole of {n} elements to a quarter turn, Poisson's ratio 0.45",
        "Lamé's solution on the sphere; with the displacement within elements",
        error,
        0.08 if n == 3 else 0.05,
    )
    assert error < 0.65 * without
