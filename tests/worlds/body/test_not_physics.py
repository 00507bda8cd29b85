"""What is no physics: recorded surfaces that are off, and forces that were measured wrongly."""

import numpy as np
import pytest

from warpbrain.inference.beliefs import belief
from warpbrain.worlds.body.causes import _off_surfaces, _wrong_forces
from warpbrain.worlds.body.sensors import Sensors

POINTS, WALL = 4, 30
#: Of a brain [m].
RADIUS = 0.065


@pytest.fixture
def sensors() -> Sensors:
    """Points with three numbers each, a wall with one each, and a force."""
    random = np.random.default_rng(5)
    groups = np.concatenate([np.repeat(np.arange(POINTS), 3), POINTS + np.arange(WALL), np.repeat(POINTS + WALL, 3)])
    n = len(groups)
    normals = random.normal(size=(WALL, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    directions = np.concatenate([np.tile(np.eye(3), (POINTS, 1)), normals, np.zeros((3, 3))])
    wall = 0.03 * random.uniform(size=(WALL, 3))
    positions = np.concatenate([np.zeros((3 * POINTS, 3)), wall, np.full((3, 3), np.nan)])
    nothing = np.zeros((n, 1))
    computed = np.concatenate([np.zeros(n - 3), [0.0, 0.0, -4.0]])
    residual = np.concatenate([np.zeros(n - 3), [0.0, 3.0, 4.0 - 4.0]])
    rest = (nothing, nothing, np.zeros((n, 6)), np.ones(n), positions, directions, np.zeros((n, 3)), groups)
    from_rest = (np.zeros(n, dtype=int), np.full(n, -1), np.zeros(n), RADIUS)
    return Sensors(residual, computed, *rest, np.zeros(n, dtype=int), np.zeros(n), ("all",), *from_rest)


def test_a_surface_may_be_off_as_much_everywhere(sensors: Sensors) -> None:
    columns = _off_surfaces(sensors)
    wall = sensors.of_surfaces
    assert wall.sum() == WALL
    np.testing.assert_allclose(
        np.sum(columns[wall] ** 2, axis=1), (belief("mesh.surface_off") * RADIUS) ** 2, rtol=1e-12
    )
    assert not columns[~wall].any()


def test_a_surface_is_off_alike_where_it_is_near_and_turned_alike(sensors: Sensors) -> None:
    wall = np.flatnonzero(sensors.of_surfaces)
    covariance = _off_surfaces(sensors) @ _off_surfaces(sensors).T / (belief("mesh.surface_off") * RADIUS) ** 2
    apart = np.linalg.norm(sensors.positions[wall][:, None] - sensors.positions[wall][None], axis=2)
    turned = 0.5 + 0.5 * sensors.directions[wall] @ sensors.directions[wall].T
    near = apart < 0.005
    np.testing.assert_allclose(covariance[np.ix_(wall, wall)][near], turned[near], atol=1e-12)


def test_a_force_may_be_wrong_in_size_and_direction_by_a_part_of_it(sensors: Sensors) -> None:
    columns = _wrong_forces(sensors)
    forces = ~sensors.is_displacement
    np.testing.assert_allclose(
        columns[forces] @ columns[forces].T, (5.0 * belief("loads.force")) ** 2 * np.eye(3), atol=1e-12
    )
    assert not columns[~forces].any()
