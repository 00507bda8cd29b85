"""Displacement fields on grids: of a mesh's state, and their inverse."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.images.continuation import continued
from warpbrain.images.grid import MILLIMETRES, Grid
from warpbrain.images.inside import VoxelsInside

Singles = NDArray[np.float32]

#: Error of the inverse at a voxel's centre [mm] that is small enough, and iterations after which it stays as it is.
_TOLERANCE, _ITERATIONS = 1e-3, 60
#: Voxels that are worked on at a time, to bound the memory.
_BATCH = 2_000_000


@dataclass(frozen=True, eq=False)
class DisplacementField:
    """Vectors on a grid, linear between the centres of voxels and zero beyond the grid, as ITK reads them.

    Attributes
    ----------
    grid : Grid
    vectors : (i, j, k, 3) float32 array
        [mm, RAS]
    """

    grid: Grid
    vectors: Singles

    def on(self, grid: Grid) -> DisplacementField:
        """The same field on another grid."""
        if grid is self.grid:
            return self
        vectors = np.empty((*grid.shape, 3), dtype=np.float32)
        # a slice at a time, to bound the memory
        plane = np.stack(np.meshgrid(*(np.arange(n) for n in grid.shape[1:]), indexing="ij"), axis=-1).reshape(-1, 2)
        for i in range(grid.shape[0]):
            places = np.column_stack([np.full(len(plane), i), plane])
            vectors[i] = self.at(grid.positions(places)).reshape(*grid.shape[1:], 3)
        return DisplacementField(grid, vectors)

    def at(self, points: ArrayLike) -> Floats:
        """Vectors (n, 3) [mm, RAS] at positions (n, 3) [mm, RAS]."""
        return self.at_indices(self.grid.indices(np.asarray(points, dtype=np.float64).reshape(-1, 3)))

    def at_indices(self, indices: Floats) -> Floats:
        """Vectors (n, 3) [mm, RAS] at voxel numbers (n, 3), which need not be whole."""
        from scipy.ndimage import map_coordinates

        vectors = np.empty((len(indices), 3))
        last = np.array(self.grid.shape) - 1
        for first in range(0, len(indices), _BATCH):
            part = slice(first, first + _BATCH)
            # within half a voxel of the border ITK takes the border's value
            at = np.clip(indices[part], 0.0, last).T
            outside = ((indices[part] < -0.5) | (indices[part] > last + 0.5)).any(axis=1)
            for axis in range(3):
                vectors[part, axis] = map_coordinates(self.vectors[..., axis], at, order=1, mode="nearest")
            vectors[part][outside] = 0.0
        return vectors


@dataclass(frozen=True, eq=False)
class Inverse:
    """A displacement field the other way, and how good it is.

    Attributes
    ----------
    field : DisplacementField
    error_99 : float
        Of what the field makes of where its inverse leads, halfway between the centres of voxels, where linear
        interpolation is worst, in moved tissue: the 99th percentile of the distance from where one began [mm].
    error_largest : float
        The largest of these [mm].
    unsolved : int
        Voxels, of all, at whose centre the error is not below a thousandth of a millimetre.
    """

    field: DisplacementField
    error_99: float
    error_largest: float
    unsolved: int


def displacement_field(inside: VoxelsInside, u: Floats, middles: Floats | None = None) -> DisplacementField:
    """The displacement of a body on a grid, continued outside (see `continued`).

    Parameters
    ----------
    inside : VoxelsInside
    u : (n, 3) array
        At the nodes [m].
    middles : (m, 6, 3) array, optional
        At the midside nodes of each tetrahedron [m]; see `VoxelsInside.interpolate`.
    """
    values = MILLIMETRES * inside.interpolate(u, middles)
    return DisplacementField(inside.grid, continued(inside.image(values), inside.mask, inside.grid.voxel))


def inverse(field: DisplacementField, tissue: Bools) -> Inverse:
    """Invert a displacement field by fixed-point iteration.

    The inverse `v` of `u` has `v(x) = -u(x + v(x))`, which is iterated from `-u(x)`. It contracts where no strain is
    above one; where a step makes the error larger the step is halved.

    Parameters
    ----------
    field : DisplacementField
    tissue : (i, j, k) bool array
        Where there is tissue before it is moved: what the error is told of.
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
    from scipy.ndimage import map_coordinates

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
    inside = map_coordinates(tissue.astype(np.float32), origins.T, order=1) > 0.999
    if not inside.any():
        return np.zeros(1)
    left = leads[inside] + field.at_indices(origins[inside])
    return np.asarray(np.linalg.norm(left, axis=1))
