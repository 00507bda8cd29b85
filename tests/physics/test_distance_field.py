"""The smooth distance: planes are planes, as far as one goes, and a sphere is found to second order."""

import numpy as np
import pytest
import warp as wp
from shapes import room, sphere

from warpbrain.kernels.module import DOUBLE
from warpbrain.physics.mechanism import ClosedSurface
from warpbrain.physics.mechanisms.contact import DistanceField


def around(surface: ClosedSurface, spacing: float, points: np.ndarray, device: str) -> tuple[np.ndarray, np.ndarray]:
    """Distances and directions at points."""
    field = DistanceField(surface.points, surface.outward, spacing, surface.points, True, device, DOUBLE)
    distances = wp.zeros(len(points), dtype=wp.float64, device=device)
    directions = wp.zeros(len(points), dtype=wp.vec3d, device=device)
    field.at(wp.array(points, dtype=wp.vec3d, device=device), distances, directions)
    return distances.numpy(), directions.numpy()


def test_a_plane_is_a_plane_within_the_grid_and_beyond_it(device):
    floor = room(1.0)
    # above the middle of the floor, and far below it where there is no grid
    points = np.array([[0.1, -0.2, 0.03], [-0.23, 0.12, -0.111], [0.0, 0.0, -7.3]])
    distances, directions = around(floor, 0.05, points, device)
    np.testing.assert_allclose(distances, -points[:, 2], atol=1e-12)
    np.testing.assert_allclose(directions, np.tile([0.0, 0.0, -1.0], (3, 1)), atol=1e-12)


def test_faces_that_point_inwards_are_turned(device):
    floor = room(1.0)
    turned = ClosedSurface("room", floor.points, floor.faces[:, ::-1].copy())
    distances, _ = around(turned, 0.05, np.array([[0.0, 0.0, 0.03]]), device)
    assert distances[0] == pytest.approx(-0.03)


def test_a_sphere_is_found_to_second_order(device):
    directions = np.random.default_rng(7).normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    worst, angles = [], []
    for cuts in (3, 4, 5):
        found, normals = around(sphere(1.0, cuts), 0.25 * 2.0 ** (3 - cuts), 0.95 * directions, device)
        worst.append(np.abs(found + 0.05).max())
        angles.append(np.degrees(np.arccos(np.clip((normals * directions).sum(axis=1), -1.0, 1.0))).max())
    assert worst[0] / worst[1] > 3.0 and worst[1] / worst[2] > 3.0
    # the triangles' own normals are 4 and 2 degrees off
    assert angles[1] < 1.5 and angles[2] < 0.75
