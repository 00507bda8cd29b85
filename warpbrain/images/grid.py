"""Where the voxels of an image are, which of them are in which tetrahedron of a mesh, and fields of the mesh there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from warpbrain.arrays import Bools, Floats, Ints, Singles
from warpbrain.mesh import TetMesh
from warpbrain.mesh.quadratic import quadratic_interpolant

#: Millimetres of one metre.
MILLIMETRES = 1000.0
#: Cosine between axes of voxels from which on they are not at right angles: about 0.06 degrees.
_SKEW = 1e-3
#: Voxels of an image that are worked on at a time, to bound the memory.
_BATCH = 100_000


@dataclass(frozen=True, eq=False)
class Grid:
    """A lattice of voxels.

    `shape`: how many there are along each axis. `affine` (4, 4): from voxel numbers to positions [mm, RAS]; voxel
    numbers mean voxel centres.
    """

    shape: tuple[int, int, int]
    affine: Floats

    @classmethod
    def around(cls, mesh: TetMesh, spacing: float, margin: float) -> Grid:
        """A grid along the axes, of cubes with edges `spacing`, that ends `margin` around a mesh [mm]."""
        lowest = MILLIMETRES * mesh.points.min(axis=0) - margin
        highest = MILLIMETRES * mesh.points.max(axis=0) + margin
        affine = np.diag([spacing, spacing, spacing, 1.0])
        affine[:3, 3] = lowest
        i, j, k = (int(n) for n in np.ceil((highest - lowest) / spacing) + 1)
        return cls((i, j, k), affine)

    def with_edges(self, edge: float) -> Grid:
        """The same box in voxels whose edges are `edge` [mm] at most and more than half of it.

        Larger ones are divided, several smaller ones put together; itself, if its own are such. A voxel at the end may
        reach beyond the box.
        """
        divided = np.ceil(self.voxel / edge - 1e-3).clip(1)
        joined = np.floor(edge / self.voxel + 1e-3).clip(1)
        factor = joined / divided
        if (factor == 1.0).all():
            return self
        affine = self.affine.copy()
        affine[:3, :3] *= factor
        affine[:3, 3] = self.positions(0.5 * factor - 0.5)
        i, j, k = (int(n) for n in np.ceil(np.array(self.shape) / factor - 1e-9))
        return Grid((i, j, k), affine)

    @property
    def voxel(self) -> Floats:
        """Edges (3,) of a voxel [mm]."""
        return np.asarray(np.linalg.norm(self.affine[:3, :3], axis=0))

    @property
    def voxel_volume(self) -> float:
        """Volume of a voxel [mm3]."""
        return float(abs(np.linalg.det(self.affine[:3, :3])))

    @property
    def is_skew(self) -> bool:
        """Whether its axes are not at right angles: ITK has no such images."""
        axes = self.affine[:3, :3] / self.voxel
        return bool(np.abs(axes.T @ axes - np.eye(3)).max() > _SKEW)

    @property
    def count(self) -> int:
        """How many voxels there are."""
        return int(np.prod(self.shape, dtype=np.int64))

    def positions(self, indices: ArrayLike) -> Floats:
        """Positions (n, 3) [mm, RAS] of voxel numbers (n, 3), which need not be whole."""
        return np.asarray(indices, dtype=np.float64) @ self.affine[:3, :3].T + self.affine[:3, 3]

    def indices(self, points: ArrayLike) -> Floats:
        """Voxel numbers (n, 3), not rounded, of positions (n, 3) [mm, RAS]."""
        inverse = np.linalg.inv(self.affine)
        return np.asarray(points, dtype=np.float64) @ inverse[:3, :3].T + inverse[:3, 3]

    def batches(self) -> Iterator[tuple[slice, Ints]]:
        """Which voxels of all, in the order of a raveled array, and their numbers (n, 3): a few at a time."""
        for first in range(0, self.count, _BATCH):
            part = slice(first, min(first + _BATCH, self.count))
            yield part, np.stack(np.unravel_index(np.arange(part.start, part.stop), self.shape), axis=1)

    def steps(self, vectors: ArrayLike) -> Floats:
        """Vectors (n, 3) [mm, RAS] in voxels along the grid's axes."""
        return np.asarray(vectors, dtype=np.float64) @ np.linalg.inv(self.affine[:3, :3]).T

    def sampled(self, values: NDArray[Any], points: Floats) -> Floats:
        """Values (n,) of a field (i, j, k) on this grid at positions (n, 3) [mm, RAS], linear between voxels."""
        back = np.linalg.inv(self.affine)
        at = back[:3, :3] @ points.T + back[:3, 3:]
        return np.asarray(scipy.ndimage.map_coordinates(values, at, order=1, mode="nearest", output=np.float64))

    def contains(self, points: ArrayLike) -> Bools:
        """Which positions (n, 3) [mm, RAS] are in a voxel: (n,) bool."""
        return self.has(self.indices(points))

    def has(self, indices: Floats) -> Bools:
        """Which voxel numbers (n, 3), not rounded, are those of a voxel: (n,) bool."""
        return np.asarray(((indices >= -0.5) & (indices <= np.array(self.shape) - 0.5)).all(axis=-1))


#: How far outside a tetrahedron a voxel's centre is still inside, as a weight: rounding puts one that lies on a common
#: face outside both of its tetrahedra.
_WEIGHT = 1e-9
#: Pairs of voxel and tetrahedron that are tried at a time, to bound the memory.
_PAIRS = 1_000_000


@dataclass(frozen=True, eq=False)
class VoxelsInside:
    """Voxels whose centre is in a mesh."""

    grid: Grid
    mesh: TetMesh
    voxels: Ints  # (k,), their numbers in a raveled array of the grid's shape, increasing
    elements: Ints  # (k,), the tetrahedron that each is in
    weights: Floats  # (k, 4), barycentric coordinates in it

    @property
    def mask(self) -> Bools:
        """True for voxels inside, an array of the grid's shape."""
        mask = np.zeros(self.grid.count, dtype=bool)
        mask[self.voxels] = True
        return mask.reshape(self.grid.shape)

    def interpolate(self, values: Floats, middles: Floats | None = None) -> Floats:
        """A field of the mesh at these voxels (k, c), given at the nodes (n, c) and for quadratic elements in the
        middle of the edges of each tetrahedron (m, 6, c), in the order of `warpbrain.mesh.surface.EDGES`."""
        corners = self.mesh.tetrahedra[self.elements]
        if middles is None:
            return np.asarray(np.einsum("ka,kac->kc", self.weights, values[corners]))
        return quadratic_interpolant(self.weights, values[corners], middles[self.elements])

    def image(self, values: NDArray[Any]) -> Singles:
        """Real or whole values (k, ...) of these voxels as an image, zero elsewhere."""
        image = np.zeros((self.grid.count, *values.shape[1:]), dtype=np.float32)
        image[self.voxels] = values
        return image.reshape(*self.grid.shape, *values.shape[1:])


def voxels_inside(mesh: TetMesh, grid: Grid) -> VoxelsInside:
    """Find the voxels of a grid whose centres are in a mesh (at rest, in metres)."""
    corners = grid.indices(MILLIMETRES * mesh.points)[mesh.tetrahedra]
    sides = (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)
    gradients: Floats = np.asarray(np.linalg.inv(sides), dtype=np.float64)
    shape = np.array(grid.shape)
    # all voxels in the boxes around tetrahedra, a batch of tetrahedra at a time
    low = np.maximum(np.ceil(corners.min(axis=1) - _WEIGHT), 0).astype(np.int64)
    high = np.minimum(np.floor(corners.max(axis=1) + _WEIGHT), shape - 1).astype(np.int64)
    sizes = np.maximum(high - low + 1, 0)
    counts = sizes.prod(axis=1)
    batches = np.cumsum(counts) // _PAIRS
    none = np.zeros(0, dtype=np.int64)
    parts = [(none, none, np.zeros((0, 4)))]
    for batch in np.unique(batches[counts > 0]):
        which = np.flatnonzero((batches == batch) & (counts > 0))
        element = np.repeat(which, counts[which])
        ends = np.cumsum(counts[which])
        at = np.arange(ends[-1]) - np.repeat(ends - counts[which], counts[which])
        size = sizes[element]
        index = np.stack([at // (size[:, 1] * size[:, 2]), at // size[:, 2] % size[:, 1], at % size[:, 2]], axis=1)
        index += low[element]
        weights = np.empty((len(element), 4))
        weights[:, 1:] = np.einsum("kij,kj->ki", gradients[element], index - corners[element, 0])
        weights[:, 0] = 1.0 - weights[:, 1:].sum(axis=1)
        within = (weights >= -_WEIGHT).all(axis=1)
        parts.append((np.ravel_multi_index(tuple(index[within].T), grid.shape), element[within], weights[within]))
    voxels, elements, weights = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    voxels, first = np.unique(voxels, return_index=True)
    return VoxelsInside(grid, mesh, voxels, elements[first], weights[first])
