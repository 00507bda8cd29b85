"""Where the voxels of an image are."""

import numpy as np
from image_grids import turned_grid


def test_other_edges_fill_the_same_box():
    grid = turned_grid((6, 7, 8), (3.0, 0.7, 0.4))
    other = grid.with_edges(1.0)
    assert other.shape == (18, 7, 4)
    np.testing.assert_allclose(other.voxel, [1.0, 0.7, 0.8])
    np.testing.assert_allclose(other.positions([-0.5, -0.5, -0.5]), grid.positions([-0.5, -0.5, -0.5]))
    np.testing.assert_allclose(other.positions([17.5, 6.5, 3.5]), grid.positions([5.5, 6.5, 7.5]))
    assert turned_grid((6, 7, 8), (0.6, 1.0, 0.9)).with_edges(1.0).shape == (6, 7, 8)
    # the last voxel reaches beyond
    assert turned_grid((5, 5, 5), (0.5, 0.5, 0.5)).with_edges(1.0).shape == (3, 3, 3)


def test_positions_and_indices_are_inverse():
    grid = turned_grid()
    at = np.random.default_rng(0).uniform(0.0, 30.0, (20, 3))
    np.testing.assert_allclose(grid.indices(grid.positions(at)), at)
    np.testing.assert_allclose(grid.steps(grid.positions(at) - grid.positions(0 * at)), at)
    assert grid.contains(grid.positions([[-0.4, 0, 0], [-0.6, 0, 0]])).tolist() == [True, False]


def test_transforms_of_a_large_box_have_larger_voxels():
    """What a header says of a box does not decide how much memory is taken."""
    from warpbrain.report import warped

    coarse = turned_grid((200, 200, 200), (100.0, 100.0, 100.0))
    assert coarse.with_edges(1.0).count > 10**12
    bounded = warped._for_transforms(coarse)
    assert 10**6 < bounded.count <= warped._MOST_VOXELS
    np.testing.assert_allclose(bounded.voxel * bounded.shape, coarse.voxel * coarse.shape, rtol=0.1)
    brain = turned_grid((90, 100, 90), (2.0, 2.0, 2.0))
    np.testing.assert_allclose(warped._for_transforms(brain).voxel, 1.0)
