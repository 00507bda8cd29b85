"""Where the voxels of an image are."""

import numpy as np
from image_grids import turned_grid


def test_a_finer_grid_fills_the_same_box():
    grid = turned_grid((6, 7, 5), (3.0, 0.7, 1.0))
    finer = grid.finer(1.0)
    assert finer.shape == (18, 7, 5)
    np.testing.assert_allclose(finer.voxel, [1.0, 0.7, 1.0])
    np.testing.assert_allclose(finer.positions([-0.5, -0.5, -0.5]), grid.positions([-0.5, -0.5, -0.5]))
    np.testing.assert_allclose(finer.positions([17.5, 6.5, 4.5]), grid.positions([5.5, 6.5, 4.5]))
    assert grid.finer(3.0) is grid


def test_positions_and_indices_are_inverse():
    grid = turned_grid()
    at = np.random.default_rng(0).uniform(0.0, 30.0, (20, 3))
    np.testing.assert_allclose(grid.indices(grid.positions(at)), at)
    np.testing.assert_allclose(grid.steps(grid.positions(at) - grid.positions(0 * at)), at)
    assert grid.contains(grid.positions([[-0.4, 0, 0], [-0.6, 0, 0]])).tolist() == [True, False]
