"""Draws that are functions: drawn at anchors, and elsewhere what follows from these."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Added to the diagonal of the covariance of anchors, relative to its mean: they are dense enough for a smooth curve to
#: be singular in double precision. A draw moves by its root, 1e-4 of a standard deviation.
JITTER = 1e-8


def standard_normal(size: int, number: int | tuple[int, ...], seed: int) -> Floats:
    """Numbers (size,) of draw `number` of a seed: the same however many draws are made, and in whatever order."""
    parts = number if isinstance(number, tuple) else (number,)
    return np.random.default_rng([seed, *parts]).standard_normal(size)


@dataclass(frozen=True, eq=False)
class Anchored:
    """A normal distribution of values at anchors.

    Attributes
    ----------
    mean : (n,) array
    covariance : (n, n) array
    """

    mean: Floats
    covariance: Floats

    def weights(self, normal: Floats) -> Floats:
        """What covariances with the anchors are multiplied by to give a draw minus its mean, elsewhere or there.

        The draw has the values `L normal` at the anchors, `L L^T` the covariance, and elsewhere the mean given these:
        `c^T (L L^T)^-1 L normal = c^T L^-T normal`. Independent standard normal numbers (n,).
        """
        from scipy.linalg import solve_triangular

        return solve_triangular(self._factor, normal, lower=True, trans="T")

    @cached_property
    def _factor(self) -> Floats:
        from scipy.linalg import cholesky

        diagonal = np.diag(self.covariance)
        return cholesky(self.covariance + JITTER * diagonal.mean() * np.eye(len(diagonal)), lower=True)
