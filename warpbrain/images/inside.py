"""Which voxels of a grid are in which tetrahedron of a mesh, and fields of the mesh there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Bools, Floats, Ints, Singles
from warpbrain.images.grid import MILLIMETRES, Grid
from warpbrain.mesh import TetMesh
from warpbrain.mesh.quadratic import quadratic_interpolant

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
    parts = list(_batches(corners, gradients, np.array(grid.shape)))
    voxels = np.concatenate([voxel for voxel, _, _ in parts]) if parts else np.zeros(0, dtype=np.int64)
    voxels, first = np.unique(voxels, return_index=True)
    elements = np.concatenate([element for _, element, _ in parts])[first] if parts else voxels
    weights = np.concatenate([weight for _, _, weight in parts])[first] if parts else np.zeros((0, 4))
    return VoxelsInside(grid, mesh, voxels, elements, weights)


def _batches(corners: Floats, gradients: Floats, shape: Ints) -> Iterator[tuple[Ints, Ints, Floats]]:
    """Voxels in the boxes around tetrahedra (m, 4, 3) that are in these, a batch of tetrahedra at a time."""
    low = np.maximum(np.ceil(corners.min(axis=1) - _WEIGHT), 0).astype(np.int64)
    high = np.minimum(np.floor(corners.max(axis=1) + _WEIGHT), shape - 1).astype(np.int64)
    sizes = np.maximum(high - low + 1, 0)
    counts = sizes.prod(axis=1)
    batches = np.cumsum(counts) // _PAIRS
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
        index = index[within]
        yield (index[:, 0] * shape[1] + index[:, 1]) * shape[2] + index[:, 2], element[within], weights[within]
