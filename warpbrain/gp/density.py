"""A density from samples, on a box some sides of which may be open."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

#: Smallest width of a kernel along a bounded coordinate, relative to the box: where all samples are on one side, their
#: spread gives none.
NARROWEST = 0.01


@dataclass(frozen=True, eq=False)
class FoldedDensity:
    """The kernel density of samples, folded back into a box.

    Gaussian kernels have the covariance of the samples times Scott's `n^(-2 / (p + 4))`. What of a kernel lies beyond
    a side is mirrored in it, so the density is one on the box and does not sink towards its sides. Samples that pile up
    on a side, as parameters at a bound of a fit do, are a mass there that no density holds: it is spread inwards over
    the width of a kernel. Where samples fall apart into clusters, they are told apart by `clusters`, and the covariance
    is that within them: a kernel as wide as the gap between two would fill it.

    Attributes
    ----------
    samples : (n, p) array
        In the box.
    low, high : (p,) array
        Sides of the box; infinite where there is none.
    clusters : (n,) array of int
        Cluster of each sample.
    """

    samples: Floats
    low: Floats
    high: Floats
    clusters: NDArray[np.int64]

    def log_density(self, at: ArrayLike) -> Floats:
        """Log density (m,) at points (m, p); minus infinity outside of the box."""
        from scipy.linalg import solve_triangular
        from scipy.special import logsumexp

        points = np.atleast_2d(np.asarray(at, dtype=np.float64))
        count, size = self.samples.shape
        centres = solve_triangular(self._factor, self.samples.T, lower=True).T
        terms = []
        for image in self._images(points):
            away = solve_triangular(self._factor, image.T, lower=True).T
            squares = np.sum(away**2, axis=1)[:, None] - 2.0 * away @ centres.T + np.sum(centres**2, axis=1)
            terms.append(logsumexp(-0.5 * squares, axis=1))
        found: Floats = logsumexp(terms, axis=0)
        found -= np.log(count) + 0.5 * size * np.log(2.0 * np.pi) + np.log(np.diag(self._factor)).sum()
        inside = np.all((points >= self.low) & (points <= self.high), axis=1)
        return np.where(inside, found, -np.inf)

    def _images(self, points: Floats) -> list[Floats]:
        """The points and their mirror images in all sides; a kernel is narrow, so images of images are of no weight."""
        by_column = []
        for column, low, high in zip(points.T, self.low, self.high, strict=True):
            sides = [side for side in (low, high) if np.isfinite(side)]
            by_column.append([column, *(2.0 * side - column for side in sides)])
        return [np.stack(columns, axis=1) for columns in product(*by_column)]

    @cached_property
    def _factor(self) -> Floats:
        """Cholesky factor of the covariance of a kernel."""
        count, size = self.samples.shape
        away = self.samples.copy()
        for cluster in np.unique(self.clusters):
            away[self.clusters == cluster] -= away[self.clusters == cluster].mean(axis=0)
        covariance = away.T @ away / count * count ** (-2.0 / (size + 4.0))
        bounded = np.isfinite(self.high - self.low)
        widest = np.where(bounded, NARROWEST * np.where(bounded, self.high - self.low, 1.0), 0.0)
        missing = np.maximum(widest**2 - np.diag(covariance), 0.0)
        return np.linalg.cholesky(covariance + np.diag(missing))
