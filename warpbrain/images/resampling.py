"""An image of a body as the body is after it was deformed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Floats
from warpbrain.images.displacement import DisplacementField
from warpbrain.images.grid import Grid

#: Slices that are worked on at a time, to bound the memory.
_SLICES = 16


def resampled(
    values: NDArray[np.generic], grid: Grid, back: DisplacementField, *, nearest: bool
) -> NDArray[np.generic]:
    """What was at `x + back(x)` at each voxel `x` of a field.

    Parameters
    ----------
    values : (i, j, k) array
        Of the image before.
    grid : Grid
        Where its voxels are.
    back : DisplacementField
        From where things are after to where they were before, as `warpbrain.images.displacement.inverse` makes it.
    nearest : bool
        Take the nearest voxel, as labels need it; else interpolate linearly.

    Returns
    -------
    array of the shape of the field's grid
        Of the type that came in; linear interpolation of whole numbers is rounded. Zero where there was no image. Not
        a number where most of what is interpolated was none: it does not spread.
    """
    from scipy.ndimage import map_coordinates

    after = back.grid
    moved = np.zeros(after.shape, dtype=values.dtype)
    # single precision only where it holds every value
    single = np.result_type(values.dtype, np.float32) == np.float32
    source = values if nearest else values.astype(np.float32 if single else np.float64)
    known: NDArray[np.float32] | None = None
    if not nearest and values.dtype.kind == "f" and not np.isfinite(source).all():
        known = np.isfinite(source).astype(np.float32)
        source = np.where(known > 0, source, 0)
    last = np.array(grid.shape) - 1
    for first in range(0, after.shape[0], _SLICES):
        part = slice(first, min(first + _SLICES, after.shape[0]))
        axes = [np.arange(part.start, part.stop), np.arange(after.shape[1]), np.arange(after.shape[2])]
        places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        was: Floats = after.positions(places) + back.vectors[part].reshape(-1, 3)
        at = grid.indices(was)
        inside = ((at >= -0.5) & (at <= last + 0.5)).all(axis=1)
        at = np.clip(at, 0, last)
        if nearest:
            index = np.floor(at + 0.5).astype(np.int64)
            sampled = source[tuple(np.minimum(index, last).T)]
        else:
            sampled = map_coordinates(source, at.T, order=1, mode="nearest")
            if known is not None:
                share = map_coordinates(known, at.T, order=1, mode="nearest")
                sampled = np.where(share >= 0.5, sampled / np.maximum(share, 0.5), np.nan)
            if np.issubdtype(values.dtype, np.integer):
                sampled = np.rint(sampled)
        shape = (part.stop - part.start, *after.shape[1:])
        moved[part] = np.where(inside, sampled, 0).astype(values.dtype).reshape(shape)
    return moved
