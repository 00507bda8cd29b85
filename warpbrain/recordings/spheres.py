"""Which spheres points touch: what makes a search among millions of triangles or tetrahedra one among dozens."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain

import numpy as np

from warpbrain.arrays import Floats, Ints

#: Pairs that are handed out at a time, to bound the memory.
PAIRS = 1_000_000


class Spheres:
    """Spheres around given centres, sorted by size so that few large ones do not widen the search for all others.

    Parameters
    ----------
    centres : (m, 3) array
    radii : (m,) array
    """

    def __init__(self, centres: Floats, radii: Floats) -> None:
        from scipy.spatial import cKDTree

        self._centres, self._radii = centres, radii
        self._all = cKDTree(centres)
        # each class spans a factor of two; what is a thousand times smaller than the largest is one class
        sizes = np.floor(np.log2(np.maximum(radii, radii.max() / 1024.0 + np.finfo(float).tiny)))
        self._classes = []
        for size in np.unique(sizes):
            ids = np.flatnonzero(sizes == size)
            self._classes.append((cKDTree(centres[ids]), ids, float(radii[ids].max())))

    def nearest(self, points: Floats, count: int) -> Ints:
        """The `count` spheres, or all if there are fewer, whose centres are nearest to each point: (n, count)."""
        count = min(count, len(self._radii))
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
                found = tree.query_ball_point(points[chosen], within[chosen], return_sorted=False)
                which = np.repeat(chosen, counts[chosen])
                spheres = ids[np.fromiter(chain.from_iterable(found), dtype=np.int64, count=len(which))]
                apart = np.linalg.norm(points[which] - self._centres[spheres], axis=1)
                near = apart <= (reach[which] + self._radii[spheres]) * (1.0 + 1e-9)
                yield which[near], spheres[near]
