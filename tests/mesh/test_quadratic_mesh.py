"""Meshes with midside nodes, and forces on their nodes."""

import numpy as np
import pytest
from manufactured import quadrature
from shapes import box, distorted, tetrahedron

from warpbrain.mesh import QuadraticMesh, TetMesh, face_vectors, surface_forces, volume_forces
from warpbrain.mesh.integrals import shape_values, tetrahedron_rule, triangle_rule
from warpbrain.mesh.surface import EDGES

MESH = distorted(box((2, 2, 2)), 0.05)
NODES = QuadraticMesh(MESH)


def test_nodes_are_in_the_middle_of_edges_and_ascend() -> None:
    elements = NODES.elements
    assert np.all(np.diff(elements, axis=1) > 0)
    corners = MESH.points[elements[:, :4]]
    np.testing.assert_allclose(NODES.points[elements[:, 4:]], corners[:, EDGES].mean(axis=2), atol=1e-15)
    assert len(np.unique(elements)) == len(NODES.points)


def test_faces_have_their_middles() -> None:
    ends = NODES.points[NODES.faces[:, [[0, 1], [0, 2], [1, 2]]]]
    np.testing.assert_allclose(NODES.points[NODES.faces[:, 3:]], ends.mean(axis=2), atol=1e-15)
    outwards = face_vectors(NODES.points, NODES.faces[:, :3])
    middles = NODES.points[NODES.faces[:, :3]].mean(axis=1) - 0.5
    assert np.all(np.einsum("ij,ij->i", outwards, middles) > 0.0)


@pytest.mark.parametrize("degree", range(6))
def test_the_rule_on_tetrahedra_is_of_degree_5(degree: int) -> None:
    bary, weights = tetrahedron_rule()
    exact, exact_weights = quadrature(4)

    def mean(points: np.ndarray, parts: np.ndarray) -> float:
        return float(np.sum(parts * points[:, 0] ** (degree // 2) * points[:, 1] ** (degree - degree // 2)))

    assert mean(bary, weights) == pytest.approx(mean(exact, exact_weights), rel=1e-13)


def test_shape_functions_are_one_at_their_nodes() -> None:
    corners = np.eye(4)
    np.testing.assert_allclose(shape_values(np.concatenate([corners, corners[EDGES].mean(axis=1)])), np.eye(10))
    corners = np.eye(3)
    middles = corners[[[0, 1], [0, 2], [1, 2]]].mean(axis=1)
    np.testing.assert_allclose(shape_values(np.concatenate([corners, middles])), np.eye(6))


def test_a_constant_force_leaves_corners_of_an_element_pushed_back() -> None:
    mesh = tetrahedron()
    force = volume_forces(QuadraticMesh(mesh), lambda x: np.ones_like(x))[:, 0]
    np.testing.assert_allclose(force, mesh.volume * np.repeat([-1.0 / 20.0, 1.0 / 5.0], [4, 6]), rtol=1e-13)


def test_forces_do_the_work_of_what_they_are_of() -> None:
    """Along a quadratic displacement, whose work the shape functions hold exactly."""

    def moved(x: np.ndarray) -> np.ndarray:
        return np.stack([x[:, 0] * x[:, 1], x[:, 2] ** 2, x[:, 0] - x[:, 2]], axis=1)

    def field(x: np.ndarray) -> np.ndarray:
        return np.stack([x[:, 2] ** 2, x[:, 0], 1.0 + x[:, 1]], axis=1)

    bary, weights = quadrature(4)
    x = np.einsum("qa,eai->eqi", bary, MESH.points[MESH.tetrahedra]).reshape(-1, 3)
    density = np.sum(field(x) * moved(x), axis=1).reshape(len(MESH.tetrahedra), -1)
    work = np.sum(volume_forces(NODES, field) * moved(NODES.points))
    assert work == pytest.approx(MESH.volumes @ density @ weights, rel=1e-12)

    bary, weights = triangle_rule()
    corners = NODES.points[NODES.faces[:, :3]]
    areas = np.linalg.norm(face_vectors(NODES.points, NODES.faces[:, :3]), axis=1)
    x = np.einsum("qa,eai->eqi", bary, corners).reshape(-1, 3)
    density = np.sum(field(x) * moved(x), axis=1).reshape(len(corners), -1)
    work = np.sum(surface_forces(NODES, field) * moved(NODES.points))
    assert work == pytest.approx(areas @ density @ weights, rel=1e-12)


def test_volumes_of_nodes_are_positive_and_add_up() -> None:
    assert NODES.node_volumes.min() > 0.0
    assert NODES.node_volumes.sum() == pytest.approx(MESH.volume)


def test_forces_at_corners_have_the_same_sum_and_moments() -> None:
    force = np.random.default_rng(0).normal(size=NODES.points.shape)
    found = NODES.at_corners(force)
    np.testing.assert_allclose(found.sum(axis=0), force.sum(axis=0), atol=1e-12)
    moments = np.cross(MESH.points, found).sum(axis=0)
    np.testing.assert_allclose(moments, np.cross(NODES.points, force).sum(axis=0), atol=1e-12)


def test_sets_are_inherited_by_what_lies_between() -> None:
    mesh = box((2, 2, 2))
    ends = np.abs(mesh.points[:, 0] - 0.5) > 0.4
    nodes = QuadraticMesh(TetMesh(mesh.points, mesh.tetrahedra, node_sets={"ends": ends}))
    np.testing.assert_array_equal(nodes.node_sets["ends"], np.abs(nodes.points[:, 0] - 0.5) > 0.4)
    np.testing.assert_array_equal(nodes.inherited(ends), nodes.node_sets["ends"])
