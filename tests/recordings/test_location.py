"""Points in meshes: linear fields are given back, and every point is found where it is."""

import numpy as np
import pytest
from scipy.spatial import Delaunay
from shapes import cube, distorted, oriented, tetrahedron

from warpbrain.mesh import TetMesh, boundary_faces
from warpbrain.recordings.closest import closest_points
from warpbrain.recordings.location import Location, locate


def delaunay(count: int, seed: int) -> TetMesh:
    """Tetrahedra of random points, slivers and all that such a mesh has."""
    points = np.random.default_rng(seed).random((count, 3))
    tetrahedra = Delaunay(points).simplices
    sides = points[tetrahedra[:, 1:]] - points[tetrahedra[:, :1]]
    return oriented(points, tetrahedra[np.abs(np.linalg.det(sides)) > 1e-9])


MESHES = {
    "cube": cube(4),
    "distorted": distorted(cube(5), 0.02),
    "random": delaunay(300, 0),
    "one": tetrahedron(0.01),
}


@pytest.fixture(params=MESHES)
def mesh(request) -> TetMesh:
    return MESHES[request.param]


def of(mesh: TetMesh, points) -> Location:
    return locate(mesh.points, mesh.tetrahedra, points)


def inside(mesh: TetMesh, count: int, seed: int = 0):
    """Random points of random tetrahedra."""
    rng = np.random.default_rng(seed)
    corners = mesh.points[mesh.tetrahedra[rng.integers(len(mesh.tetrahedra), size=count)]]
    return np.einsum("ni,nij->nj", rng.dirichlet(np.ones(4), count), corners)


def test_linear_fields_are_given_back(mesh):
    points = inside(mesh, 2000)
    place = of(mesh, points)
    A, b = np.random.default_rng(1).normal(size=(3, 3)), np.array([1.0, 2, 3])
    np.testing.assert_allclose(place.interpolate(mesh.points @ A + b), points @ A + b, atol=1e-12)
    np.testing.assert_array_equal(place.distance, 0)
    np.testing.assert_allclose(place.weights.sum(axis=1), 1, atol=1e-14)
    assert place.weights.min() >= -1e-8


def test_every_tetrahedron_is_found_by_its_centre(mesh):
    place = of(mesh, mesh.points[mesh.tetrahedra].mean(axis=1))
    np.testing.assert_array_equal(np.sort(place.nodes, axis=1), np.sort(mesh.tetrahedra, axis=1))
    np.testing.assert_allclose(place.weights, 0.25, atol=1e-6)


def test_nodes_faces_and_edges_are_inside(mesh):
    corners = mesh.points[mesh.tetrahedra]
    for points in (mesh.points, corners[:, :3].mean(axis=1), corners[:, 1:3].mean(axis=1)):
        place = of(mesh, points)
        np.testing.assert_array_equal(place.distance, 0)
        np.testing.assert_allclose(place.interpolate(mesh.points), points, atol=1e-14)
    nodes = of(mesh, mesh.points)
    np.testing.assert_array_equal(
        nodes.nodes[np.arange(len(mesh.points)), nodes.weights.argmax(axis=1)], np.arange(len(mesh.points))
    )


def test_outside_it_is_the_closest_point_of_the_boundary(mesh):
    rng = np.random.default_rng(2)
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    points = low + (high - low) * rng.uniform(-1, 2, (500, 3))
    place = of(mesh, points)
    closest = closest_points(points, mesh.points, boundary_faces(mesh.tetrahedra))
    corners = mesh.points[mesh.tetrahedra]
    w = np.linalg.solve(
        (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)[None], (points[:, None] - corners[:, 0])[..., None]
    )
    within = ((w[..., 0] >= 0).all(axis=2) & (w[..., 0].sum(axis=2) <= 1)).any(axis=1)
    np.testing.assert_array_equal(place.distance == 0, within)
    out = ~within
    np.testing.assert_allclose(place.distance[out], closest.distance[out], rtol=1e-12)
    np.testing.assert_allclose(place.interpolate(mesh.points)[out], closest.position[out], atol=1e-12)
    np.testing.assert_array_equal(place.weights[out, 3], 0)


def test_hardly_any_volume_is_enough():
    """A sliver that the mesh just admits, and its neighbours."""
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 1e-9], [0, 1, 0], [0.5, 0.5, 1], [0.5, 0.5, -1]])
    mesh = oriented(points, np.array([[0, 1, 2, 3], [0, 1, 2, 4], [0, 2, 3, 4], [0, 1, 3, 5], [1, 2, 3, 5]]))
    rng = np.random.default_rng(3)
    flat = np.concatenate([rng.random((500, 2)), rng.uniform(0, 1e-9, (500, 1))], axis=1)
    place = of(mesh, flat)
    np.testing.assert_array_equal(place.distance, 0)
    np.testing.assert_allclose(place.interpolate(mesh.points), flat, atol=1e-15)


def test_the_matrix_does_what_interpolation_does(mesh):
    place = of(mesh, inside(mesh, 50))
    values = np.random.default_rng(0).normal(size=(len(mesh.points), 2))
    np.testing.assert_allclose(place.matrix(len(mesh.points)) @ values, place.interpolate(values), atol=1e-14)


def test_edge_lengths():
    assert of(cube(2), [[0.1, 0.2, 0.3]]).edge[0] == pytest.approx((3 + 2 * 2**0.5 + 3**0.5) / 6 / 2)


def test_no_points():
    assert len(of(cube(1), np.empty((0, 3)))) == 0
