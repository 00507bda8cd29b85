"""The points of a triangulated surface that are closest to given points."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import ArrayLike

from warpbrain.arrays import Floats, Int32s, Ints
from warpbrain.errors import InputError
from warpbrain.mesh.patches import closest_on_triangles

#: Barycentric coordinates up to this are none.
_ON = 1e-12
#: Pairs that are handed out at a time, to bound the memory.
PAIRS = 1_000_000


class Spheres:
    """Spheres (m,) around triangles or tetrahedra: which of these points can touch, dozens instead of millions.

    They are sorted by size so that few large ones do not widen the search for all others.

    `corners` (m, k, 3).
    """

    def __init__(self, corners: Floats) -> None:
        from scipy.spatial import cKDTree

        self.centres = centres = corners.mean(axis=1)
        self.radii = radii = np.linalg.norm(corners - centres[:, None], axis=2).max(axis=1)
        self._all = cKDTree(centres)
        # each class spans a factor of two; what is a thousand times smaller than the largest is one class
        sizes = np.floor(np.log2(np.maximum(radii, radii.max() / 1024.0 + np.finfo(float).tiny)))
        self._classes = []
        for size in np.unique(sizes):
            ids = np.flatnonzero(sizes == size)
            self._classes.append((cKDTree(centres[ids]), ids, float(radii[ids].max())))

    def nearest(self, points: Floats, count: int) -> Ints:
        """The `count` spheres, or all if there are fewer, whose centres are nearest to each point: (n, count)."""
        count = min(count, len(self.radii))
        return np.asarray(self._all.query(points, k=count)[1], dtype=np.int64).reshape(len(points), count)

    def touching(self, points: Floats, reach: Floats) -> Iterator[tuple[Ints, Ints]]:
        """All pairs (point, sphere) no farther apart than `reach` (n,) of the point, a batch at a time."""
        reach = reach * (1.0 + 1e-9)
        for tree, ids, largest in self._classes:
            within = (reach + largest) * (1.0 + 1e-9)
            counts = tree.query_ball_point(points, within, return_length=True)
            batches = np.cumsum(counts) // PAIRS
            for batch in np.unique(batches[counts > 0]):
                chosen = np.flatnonzero((batches == batch) & (counts > 0))
                neighbours = tree.query_ball_point(points[chosen], within[chosen], return_sorted=False)
                which = np.repeat(chosen, counts[chosen])
                spheres = ids[np.fromiter(chain.from_iterable(neighbours), dtype=np.int64, count=len(which))]
                apart = np.linalg.norm(points[which] - self.centres[spheres], axis=1)
                near = apart <= (reach[which] + self.radii[spheres]) * (1.0 + 1e-9)
                yield which[near], spheres[near]


@dataclass(frozen=True, eq=False)
class ClosestPoints:
    """Closest points of a surface."""

    position: Floats  # (n, 3), where they are
    face: Int32s  # (n,), triangle on which each lies; of several, the one with the smallest number
    weights: Floats  # (n, 3), barycentric coordinates there: not negative, their sum is 1
    distance: Floats  # (n,), from the given point

    @property
    def features(self) -> Ints:
        """On which feature (n,) of its triangle each lies, as `warpbrain.mesh.surface` numbers them."""
        zero = self.weights <= _ON
        edges = np.select([zero[:, 2], zero[:, 0], zero[:, 1]], [1, 2, 3], 0)
        return np.asarray(np.where(zero.sum(axis=1) == 2, 4 + np.argmax(self.weights, axis=1), edges))


def closest_points(points: ArrayLike, vertices: ArrayLike, faces: ArrayLike) -> ClosestPoints:
    """Closest points of a surface, exact to rounding; triangles without area count as the segments they are.

    `points` (n, 3).
    `vertices` (v, 3).
    `faces` (k, 3): ids of vertices.

    `InputError` if there are no faces.
    """
    xyz = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    triangles = np.asarray(faces)
    if len(triangles) == 0:
        raise InputError("a surface without faces has no closest points")
    corners = np.asarray(vertices, dtype=np.float64)[triangles]
    spheres = Spheres(corners)
    centres, radii = spheres.centres, spheres.radii
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1)
    # the normal of a sliver points anywhere: it has none, and counts as a sphere
    normals /= np.where(length > 1e-8 * radii**2, length, np.inf)[:, None]
    near = spheres.nearest(xyz, 4)
    face = np.zeros(len(xyz), dtype=np.int64)
    distance = np.full(len(xyz), np.inf)
    weights = np.zeros((len(xyz), 3))

    def improve(which: Ints, candidates: Ints) -> None:
        """Take over the candidates that are closer than the best so far; a tie goes to the smaller number."""
        barycentric, apart = closest_on_triangles(xyz[which], corners[candidates])
        order = np.lexsort((candidates, apart, which))
        first = order[np.append(True, which[order][1:] != which[order][:-1])] if len(order) else order
        at = which[first]
        closer = (apart[first] < distance[at]) | ((apart[first] == distance[at]) & (candidates[first] < face[at]))
        first, at = first[closer], at[closer]
        face[at], distance[at], weights[at] = candidates[first], apart[first], barycentric[first]

    for column in near.T:
        improve(np.arange(len(xyz)), column)
    # whatever is closer than the best so far touches the sphere of that radius
    for which, candidates in spheres.touching(xyz, distance.copy()):
        # and, being flat, the disc in that sphere, which leaves few where the surface is far away
        offset = xyz[which] - centres[candidates]
        height = np.einsum("ij,ij->i", offset, normals[candidates])
        aside = np.sqrt(np.maximum(np.einsum("ij,ij->i", offset, offset) - height**2, 0.0)) - radii[candidates]
        reach = distance[which] + 1e-6 * (distance[which] + radii[candidates])
        near_enough = np.hypot(height, np.maximum(aside, 0.0)) <= reach
        improve(which[near_enough], candidates[near_enough])
    position = np.einsum("ni,nij->nj", weights, corners[face])
    return ClosestPoints(position, face.astype(np.int32), weights, distance)
