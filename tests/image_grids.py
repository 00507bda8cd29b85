"""Grids of images around a block."""

import numpy as np

from warpbrain.images.grid import Grid

#: Edge of the block [m].
SIZE = 0.03


def turned_grid(shape=(34, 36, 38), voxel=(1.1, 1.0, 0.9)) -> Grid:
    """A grid around the block whose axes are turned and reflected."""
    a, b = 0.4, -0.3
    turn = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, -1]]) @ np.array(
        [[1, 0, 0], [0, np.cos(b), -np.sin(b)], [0, np.sin(b), np.cos(b)]]
    )
    affine = np.eye(4)
    affine[:3, :3] = turn @ np.diag(voxel)
    affine[:3, 3] = 15.0 - affine[:3, :3] @ ((np.array(shape) - 1) / 2)
    return Grid(shape, affine)
