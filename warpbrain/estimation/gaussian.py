"""A normal distribution of the parameters: what is believed before anything was observed, or known after it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import InputError


@dataclass(frozen=True, eq=False)
class Gaussian:
    """A normal distribution of `theta`: mean (p,) and covariance (p, p), positive definite or `InputError`."""

    mean: Floats
    covariance: Floats

    def __post_init__(self) -> None:
        try:
            _ = self.factor
        except np.linalg.LinAlgError:
            raise InputError("the covariance of the parameters is not positive definite") from None

    @cached_property
    def factor(self) -> Floats:
        """Cholesky factor `L` of the covariance, which takes independent unit normals to `theta - mean`."""
        return np.asarray(np.linalg.cholesky(self.covariance), dtype=np.float64)

    @cached_property
    def precision(self) -> Floats:
        """Inverse of the covariance."""
        inverse = np.linalg.inv(self.factor)
        return inverse.T @ inverse

    @property
    def standard_deviations(self) -> Floats:
        """Of each parameter, shape (p,)."""
        return np.sqrt(np.diag(self.covariance))

    def negative_log(self, theta: Floats) -> float:
        """Negative log density, less its constant."""
        return 0.5 * float((theta - self.mean) @ self.gradient(theta))

    def gradient(self, theta: Floats) -> Floats:
        """Of the negative log density, shape (p,)."""
        return self.precision @ (theta - self.mean)
