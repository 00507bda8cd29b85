"""Closest points of surfaces, against a search over every triangle by another method."""

import numpy as np
import pytest
from scipy.optimize import nnls

from warpbrain.errors import InputError
from warpbrain.recordings.closest import closest_points


def brute_force(point, vertices, faces):
    """Least distance to any triangle: weights that are not negative and sum to 1, by least squares."""
    distances = []
    for face in faces:
        scale = 1e6
        A = np.vstack([vertices[face].T, np.full(3, scale)])
        weights = nnls(A, np.append(point, scale))[0]
        weights /= weights.sum()
        distances.append(np.linalg.norm(weights @ vertices[face] - point))
    return min(distances)


@pytest.mark.parametrize("seed", range(6))
def test_random_triangles(seed):
    rng = np.random.default_rng(seed)
    vertices = rng.normal(size=(30, 3))
    faces = rng.integers(0, 30, (25, 3))  # some name a vertex twice
    # triangles of very different size, slivers, and a point far away
    vertices[:10] *= 0.01
    vertices[1] = vertices[0] + 1e-9 * rng.normal(size=3)
    points = np.concatenate([rng.normal(size=(20, 3)), vertices[faces].mean(axis=1)[:5], [[100.0, 50, 20]]])
    found = closest_points(points, vertices, faces)
    expected = [brute_force(point, vertices, faces) for point in points]
    np.testing.assert_allclose(found.distance, expected, rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(np.linalg.norm(found.position - points, axis=1), found.distance, atol=1e-14)
    np.testing.assert_allclose(found.weights.sum(axis=1), 1, atol=1e-14)
    assert (found.weights >= 0).all()
    at = np.einsum("ni,nij->nj", found.weights, vertices[faces[found.face]])
    np.testing.assert_allclose(at, found.position, atol=1e-14)


def test_points_of_the_surface_are_their_own_closest():
    rng = np.random.default_rng(1)
    vertices, faces = rng.normal(size=(40, 3)), rng.permutation(40)[:39].reshape(13, 3)
    weights = rng.dirichlet(np.ones(3), 13)
    on = np.einsum("ni,nij->nj", weights, vertices[faces])
    found = closest_points(np.concatenate([on, vertices[faces[:, 0]]]), vertices, faces)
    np.testing.assert_allclose(found.distance, 0, atol=1e-15)
    np.testing.assert_allclose(found.weights[:13], weights, atol=1e-12)
    np.testing.assert_array_equal(found.face, np.tile(np.arange(13), 2))


def test_every_region_of_a_triangle():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    points = [[0.2, 0.2, 3], [0.5, -2, 0], [1, 1, 0], [-1, 0.5, 0], [-1, -1, 0], [3, -1, 0], [-1, 3, 0]]
    closest = [[0.2, 0.2, 0], [0.5, 0, 0], [0.5, 0.5, 0], [0, 0.5, 0], [0, 0, 0], [1, 0, 0], [0, 1, 0]]
    np.testing.assert_allclose(closest_points(points, vertices, [[0, 1, 2]]).position, closest, atol=1e-15)


@pytest.mark.parametrize("vertices", [[[0, 0, 0], [0, 0, 0], [2, 0, 0]], [[0, 0, 0], [1, 0, 0], [2, 0, 0]]])
def test_triangles_without_area_are_segments(vertices):
    found = closest_points([[1, 1, 0], [3, 0, 0]], vertices, [[0, 1, 2]])
    np.testing.assert_allclose(found.position, [[1, 0, 0], [2, 0, 0]], atol=1e-15)


def test_no_points_and_no_faces():
    vertices = np.eye(3)
    assert len(closest_points(np.empty((0, 3)), vertices, [[0, 1, 2]]).distance) == 0
    with pytest.raises(InputError, match="without faces"):
        closest_points([[0, 0, 0]], vertices, np.empty((0, 3), dtype=int))
