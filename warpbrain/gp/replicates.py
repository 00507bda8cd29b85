"""Replicated observations, reduced without loss.

Many published curves are sampled on one grid of stretches. A Gaussian process with independent noise sees of `n`
observations of one task at one stretch only their mean and their sum of squares about it: with
`y_i = f + e_i`, `e_i ~ N(0, s2)`,

    prod_i N(y_i; f, s2) = N(mean(y); f, s2 / n) * (2 pi s2)^(-(n - 1) / 2) n^(-1/2) exp(-SS / (2 s2))

so that 7300 observations become some 1500 and nothing is approximated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Replicates:
    """Means of observations that share task and stretch.

    Attributes
    ----------
    task : (m,) int array
    x : (m,) array
    mean : (m,) array
        Mean of the observations there.
    count : (m,) int array
        How many there are.
    scatter : (m,) array
        Sum of their squared distances from the mean.
    """

    task: Ints
    x: Floats
    mean: Floats
    count: Ints
    scatter: Floats

    @classmethod
    def of(cls, task: ArrayLike, x: ArrayLike, y: ArrayLike, digits: int = 12) -> Replicates:
        """Reduce observations: task (n,), stretch (n,) and value (n,); stretches that agree to `digits` are one."""
        tasks, xs, ys = (
            np.asarray(task, dtype=np.int64),
            np.asarray(x, dtype=np.float64),
            np.asarray(y, dtype=np.float64),
        )
        key = np.stack([tasks, np.round(xs, digits)], axis=1)
        _, first, inverse, count = np.unique(key, axis=0, return_index=True, return_inverse=True, return_counts=True)
        inverse = inverse.ravel()
        mean = np.bincount(inverse, weights=ys) / count
        scatter = np.bincount(inverse, weights=(ys - mean[inverse]) ** 2).astype(np.float64)
        return cls(tasks[first], xs[first], mean, count.astype(np.int64), scatter)

    @property
    def size(self) -> int:
        """How many means there are."""
        return len(self.x)

    def thinned(self, step: int) -> Replicates:
        """Every `step`-th stretch of each task, from its lowest: a cheap picture of the whole."""
        order = np.lexsort((self.x, self.task))
        place = np.arange(self.size) - np.searchsorted(self.task[order], self.task[order])
        keep = order[place % step == 0]
        return Replicates(self.task[keep], self.x[keep], self.mean[keep], self.count[keep], self.scatter[keep])
