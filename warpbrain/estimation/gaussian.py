"""What is believed of the parameters before anything was observed, as a normal distribution."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from warpbrain.errors import InputError

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Gaussian:
    """A normal distribution of `theta`.

    Parameters
    ----------
    mean : (p,) array
    covariance : (p, p) array
        Symmetric and positive definite.

    Raises
    ------
    InputError
        If a shape is wrong, a number is not finite or the covariance is not positive definite.
    """

    mean: Floats
    covariance: Floats

    def __post_init__(self) -> None:
        mean, covariance = np.asarray(self.mean, dtype=float), np.asarray(self.covariance, dtype=float)
        size = len(mean) if mean.ndim == 1 else -1
        if covariance.shape != (size, size):
            raise InputError(
                f"prior: mean of shape {mean.shape} and covariance of {covariance.shape}: expected (p,) and (p, p)"
            )
        if not (np.isfinite(mean).all() and np.isfinite(covariance).all()):
            raise InputError("prior: mean and covariance must be finite")
        object.__setattr__(self, "mean", mean)
        object.__setattr__(self, "covariance", covariance)
        try:
            _ = self.factor
        except np.linalg.LinAlgError:
            raise InputError("prior: the covariance is not positive definite") from None
        if not np.allclose(covariance, covariance.T, rtol=1e-9, atol=0.0):
            raise InputError("prior: the covariance is not symmetric")

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
        away = theta - self.mean
        return 0.5 * float(away @ self.precision @ away)
