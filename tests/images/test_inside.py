"""Fields of a mesh on a grid of voxels."""

import numpy as np
import pytest
from image_grids import SIZE, turned_grid
from shapes import box

from warpbrain.images.grid import MILLIMETRES, Grid, voxels_inside
from warpbrain.mesh.surface import EDGES
from warpbrain.recordings.location import locate


def test_voxels_are_those_in_the_block():
    grid = turned_grid()
    inside = voxels_inside(box((2, 3, 2), (SIZE,) * 3), grid)
    at = grid.positions(np.argwhere(np.ones(grid.shape)))
    expected = ((at > 0.0) & (at < 1000 * SIZE)).all(axis=1)
    np.testing.assert_array_equal(inside.mask.ravel(), expected)
    np.testing.assert_allclose(inside.weights.sum(axis=1), 1.0)


def test_linear_fields_are_exact_and_others_are_those_of_the_elements():
    mesh, grid = box((2, 2, 2), (SIZE,) * 3), turned_grid()
    inside = voxels_inside(mesh, grid)
    at = grid.positions(np.argwhere(inside.mask)) / MILLIMETRES
    slope = np.array([[0.1, 0.2, -0.3], [0.0, 0.5, 0.1], [-0.2, 0.3, 0.4]])
    np.testing.assert_allclose(inside.interpolate(mesh.points @ slope), at @ slope, atol=1e-15)
    rough = np.random.default_rng(0).normal(size=(len(mesh.points), 3))
    expected = locate(mesh.points, mesh.tetrahedra, at).interpolate(rough)
    np.testing.assert_allclose(inside.interpolate(rough), expected, atol=1e-9)


def test_quadratic_fields_are_exact_with_midside_nodes(verify):
    mesh, grid = box((2, 2, 2), (SIZE,) * 3), turned_grid()
    inside = voxels_inside(mesh, grid)
    at = grid.positions(np.argwhere(inside.mask)) / MILLIMETRES

    def field(x):
        return np.stack([x[..., 0] * x[..., 1], x[..., 2] ** 2 - x[..., 0], 3 * x[..., 1] ** 2], axis=-1)

    middles = field(mesh.points[mesh.tetrahedra][:, EDGES].mean(axis=2))
    found = inside.interpolate(field(mesh.points), middles)
    verify(
        "a quadratic displacement on the voxels of an image is that of ten-node tetrahedra",
        "the polynomial itself",
        np.abs(found - field(at)).max() / np.abs(field(at)).max(),
        1e-13,
    )


@pytest.mark.parametrize("shift", [100.0, -100.0])
def test_a_grid_elsewhere_has_no_voxel_inside(shift):
    affine = np.eye(4)
    affine[:3, 3] = shift
    inside = voxels_inside(box((1, 1, 1), (SIZE,) * 3), Grid((5, 5, 5), affine))
    assert len(inside.voxels) == 0
    assert not inside.mask.any()
