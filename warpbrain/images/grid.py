"""Where the voxels of an image are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from warpbrain.arrays import Bools, Floats
from warpbrain.mesh import TetMesh

#: Millimetres of one metre.
MILLIMETRES = 1000.0
#: Cosine between axes of voxels from which on they are not at right angles: about 0.06 degrees.
_SKEW = 1e-3


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
        at = self.indices(points)
        return np.asarray(((at >= -0.5) & (at <= np.array(self.shape) - 0.5)).all(axis=-1))
