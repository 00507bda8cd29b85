"""Displacement fields on grids: of a mesh's state, their inverse, and images as these deform them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from warpbrain.arrays import Bools, Floats, Ints, Singles
from warpbrain.images.continuation import continued
from warpbrain.images.grid import MILLIMETRES, Grid, VoxelsInside

#: Error of the inverse at a voxel's centre [mm] that is small enough, and iterations after which it stays as it is.
_TOLERANCE, _ITERATIONS = 1e-3, 60
#: Voxels that are worked on at a time, to bound the memory.
_BATCH = 2_000_000


@dataclass(frozen=True, eq=False)
class DisplacementField:
    """Vectors on a grid, linear between the centres of voxels and zero beyond the grid, as ITK reads them."""

    grid: Grid
    vectors: Singles  # (i, j, k, 3) [mm, RAS]

    def on(self, grid: Grid) -> DisplacementField:
        """The same field on another grid."""
        if grid is self.grid:
            return self
        vectors = np.empty((grid.count, 3), dtype=np.float32)
        for part, places in grid.batches():
            vectors[part] = self.at(grid.positions(places))
        return DisplacementField(grid, vectors.reshape(*grid.shape, 3))

    def at(self, points: ArrayLike) -> Floats:
        """Vectors (n, 3) [mm, RAS] at positions (n, 3) [mm, RAS]."""
        return self.at_indices(self.grid.indices(np.asarray(points, dtype=np.float64).reshape(-1, 3)))

    def at_indices(self, indices: Floats) -> Floats:
        """Vectors (n, 3) [mm, RAS] at voxel numbers (n, 3), which need not be whole."""
        vectors = np.empty((len(indices), 3))
        last = np.array(self.grid.shape) - 1
        for first in range(0, len(indices), _BATCH):
            part = slice(first, first + _BATCH)
            # within half a voxel of the border ITK takes the border's value
            inside, at = self.grid.has(indices[part]), np.clip(indices[part], 0.0, last).T
            for axis in range(3):
                values = scipy.ndimage.map_coordinates(self.vectors[..., axis], at, order=1, mode="nearest")
                vectors[part, axis] = np.where(inside, values, 0.0)
        return vectors


@dataclass(frozen=True, eq=False)
class Inverse:
    """A displacement field the other way, and how good it is."""

    field: DisplacementField
    #: Of what the field makes of where its inverse leads, halfway between the centres of voxels, where linear
    #: interpolation is worst, in moved tissue: the 99th percentile of the distance from where one began [mm].
    error_99: float
    error_largest: float  # the largest of these [mm]
    unsolved: int  # voxels, of all, at whose centre the error is not below a thousandth of a millimetre


def displacement_field(inside: VoxelsInside, u: Floats, middles: Floats | None = None) -> DisplacementField:
    """The displacement [m] of a body, at nodes (n, 3) and perhaps at the midside nodes (m, 6, 3) of each tetrahedron,
    on a grid, continued outside (see `continued`)."""
    values = MILLIMETRES * inside.interpolate(u, middles)
    return DisplacementField(inside.grid, continued(inside.image(values), inside.mask, inside.grid.voxel))


def inverse(field: DisplacementField, tissue: Bools) -> Inverse:
    """Invert a displacement field by fixed-point iteration.

    The inverse `v` of `u` has `v(x) = -u(x + v(x))`, which is iterated from `-u(x)`. It contracts where no strain is
    above one; where a step makes the error larger the step is halved. The error is told of `tissue` (i, j, k), where
    there is some before it is moved.
    """
    grid = field.grid
    vectors = -field.vectors.reshape(-1, 3)
    active: Ints = np.flatnonzero(np.linalg.norm(vectors, axis=1) > _TOLERANCE)
    unsolved = 0
    for first in range(0, len(active), _BATCH):
        part = active[first : first + _BATCH]
        vectors[part], left = _inverted(field, part)
        unsolved += left
    back = DisplacementField(grid, vectors.reshape(field.vectors.shape))
    errors = _errors(field, back, tissue)
    return Inverse(back, float(np.percentile(errors, 99.0)), float(errors.max()), unsolved)


def _inverted(field: DisplacementField, voxels: Ints) -> tuple[Floats, int]:
    """The inverse (n, 3) at some voxels, and how many of them have none that is good enough."""
    grid = field.grid
    places = np.stack(np.unravel_index(voxels, grid.shape), axis=1).astype(np.float64)
    vectors = -field.vectors.reshape(-1, 3)[voxels].astype(np.float64)
    active: Ints = np.arange(len(voxels))
    best = tried = vectors.copy()
    error, step = np.full(len(voxels), np.inf), np.ones(len(voxels))
    residual = np.zeros_like(best)
    for _ in range(_ITERATIONS):
        left = tried + field.at_indices(places + grid.steps(tried))
        size = np.linalg.norm(left, axis=1)
        better = size < error
        best = np.where(better[:, None], tried, best)
        residual = np.where(better[:, None], left, residual)
        error = np.where(better, size, error)
        step = np.where(better, step, 0.5 * step)
        vectors[active] = best
        going = error > _TOLERANCE
        active, places, error, step = active[going], places[going], error[going], step[going]
        best, residual = best[going], residual[going]
        if not len(active):
            break
        tried = best - step[:, None] * residual
    return vectors, len(active)


def _errors(field: DisplacementField, back: DisplacementField, tissue: Bools) -> Floats:
    """Errors (n,) [mm] of forward after back, between the voxels of moved tissue."""
    grid = field.grid
    moved = np.linalg.norm(field.vectors, axis=-1)
    # places whose voxel may hold moved tissue: those around it as far as anything moves
    reach = moved[tissue].max(initial=0.0) / grid.voxel.min() + 1.0
    corners = np.argwhere(tissue)
    if not len(corners):
        return np.zeros(1)
    low = np.maximum(np.floor(corners.min(axis=0) - reach), 0).astype(int)
    high = np.minimum(np.ceil(corners.max(axis=0) + reach), np.array(grid.shape) - 2).astype(int)
    axes = [np.arange(a, b + 1) + 0.5 for a, b in zip(low, high, strict=True)]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    leads = back.at_indices(places)
    origins = places + grid.steps(leads)
    inside = scipy.ndimage.map_coordinates(tissue.astype(np.float32), origins.T, order=1) > 0.999
    if not inside.any():
        return np.zeros(1)
    left = leads[inside] + field.at_indices(origins[inside])
    return np.asarray(np.linalg.norm(left, axis=1))


def resampled(
    values: NDArray[np.generic], grid: Grid, back: DisplacementField, *, nearest: bool
) -> NDArray[np.generic]:
    """Values of an image on a grid (i, j, k), at `x + back(x)` for each voxel `x` of the field's own grid.

    `back` leads from where things are after to where they were before, as `inverse` makes it. `nearest` takes the
    nearest voxel, as labels need it; else values are interpolated linearly. They keep their type: whole numbers are
    rounded. They are zero where there was no image, and not a number where most of what is interpolated was none: it
    does not spread.
    """
    after = back.grid
    moved = np.zeros(after.count, dtype=values.dtype)
    # single precision only where it holds every value
    single = np.result_type(values.dtype, np.float32) == np.float32
    source = values if nearest else values.astype(np.float32 if single else np.float64)
    known: Singles | None = None
    if not nearest and values.dtype.kind == "f" and not np.isfinite(source).all():
        known = np.isfinite(source).astype(np.float32)
        source = np.where(known > 0, source, 0)
    last = np.array(grid.shape) - 1
    for part, places in after.batches():
        at = grid.indices(after.positions(places) + back.vectors.reshape(-1, 3)[part])
        inside, at = grid.has(at), np.clip(at, 0, last)
        if nearest:
            sampled = source[tuple(np.floor(at + 0.5).astype(np.int64).T)]
        else:
            sampled = scipy.ndimage.map_coordinates(source, at.T, order=1, mode="nearest")
            if known is not None:
                share = scipy.ndimage.map_coordinates(known, at.T, order=1, mode="nearest")
                sampled = np.where(share >= 0.5, sampled / np.maximum(share, 0.5), np.nan)
            if np.issubdtype(values.dtype, np.integer):
                sampled = np.rint(sampled)
        moved[part] = np.where(inside, sampled, 0).astype(values.dtype)
    return moved.reshape(after.shape)
