"""A normal distribution of recorded rows: correlated noise of an unknown scale, and columns with normal coefficients.

    r = U xi + kappa L eps,   xi, eps ~ N(0, I),   Cov r = S = kappa^2 L L^T + U U^T

With the eigenvectors of `(L^-1 U)^T (L^-1 U)` the square root of `S` is known for every `kappa`, at the cost of
products of n by q, the number of columns, which is smaller than the number n of rows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints

Made = TypeVar("Made")

#: Rounding errors of eigenvalues of `W^T W`, in variances of the noise, with which singular values of `W` are computed.
_ROUNDED = 1e-3


class _Noise:
    """Covariance of the noise and its inverse: shared by models with the same noise, made when they are first used."""

    def __init__(self, factor: Floats) -> None:
        self._factor = factor
        #: What was made of it last, and of what else.
        self.made: tuple[object, Any] | None = None

    @cached_property
    def covariance(self) -> Floats:
        """`L L^T` (n, n)."""
        return self._factor @ self._factor.T

    @cached_property
    def precision(self) -> Floats:
        """`(L L^T)^-1` (n, n)."""
        from scipy.linalg.lapack import dpotri

        lower, _ = dpotri(self._factor, lower=1)
        return np.asarray(np.tril(lower) + np.tril(lower, -1).T)


class _Spectrum:
    """Eigenvalues (k,) of `W^T W`, `W = L^-1 U`, and `W` times its eigenvectors (n, k): the same at all scales.

    `W` without the columns that are zero, whose eigenvalues are. `factor` (n, n): `L`. `whitened` (n, q): with them.
    """

    def __init__(self, factor: Floats, whitened: Floats) -> None:
        self._factor = factor
        whitened = whitened[:, whitened.any(axis=0)]
        values, vectors = np.linalg.eigh(whitened.T @ whitened)
        self.values, self.directions = np.maximum(values, 0.0), whitened @ vectors
        if np.finfo(np.float64).eps * values.max(initial=0.0) > _ROUNDED:
            from scipy.linalg import svd

            # a column ten million times as long as the noise: its square has no digits left for the others; gesdd
            # can fail to converge
            left, sizes, _ = svd(whitened, full_matrices=False, lapack_driver="gesvd")
            self.values, self.directions = sizes**2, left * sizes

    @cached_property
    def dual(self) -> Floats:
        """`L^-T` times the directions (n, k)."""
        from scipy.linalg import solve_triangular

        return np.asarray(solve_triangular(self._factor, self.directions, lower=True, trans="T", check_finite=False))


@dataclass(frozen=True, eq=False)
class WhiteRows:
    """Rows in coordinates in which the noise alone is `N(0, I)`, apart from its scale."""

    rows: Floats  # (n,), or (b, n) one after the other
    projected: Floats  # (k,) or (b, k), `W V`: on the directions
    values: Floats  # (k,), of the spectrum
    directions: Floats  # (n, k)

    def __getitem__(self, numbers: Any) -> WhiteRows:
        return WhiteRows(self.rows[numbers], self.projected[numbers], self.values, self.directions)

    def standardised(self, scale: float) -> Floats:
        """Rows in coordinates in which the model at a scale is `N(0, I)`, one after the other."""
        root = np.sqrt(scale**2 + self.values)
        result = (self.projected / (root * (root + scale))) @ self.directions.T
        np.subtract(self.rows, result, out=result)
        result /= scale
        return np.asarray(result)

    def weights(self, scale: float) -> Floats:
        """`w` (k,), with which products at a scale are `(x . y - sum_j w_j p_j q_j) / scale^2`, `p` and `q` projected.

        They are those of standardised rows but for rounding, which is relative to products of white ones.
        """
        return np.asarray(1.0 / (scale**2 + self.values))


@dataclass(frozen=True, eq=False)
class GaussianModel:
    """Rows with noise and normal coefficients."""

    noise_factor: Floats  # (n, n), lower triangular factor `L` of the covariance of the noise
    columns: Floats  # (n, q), `U`: what one standard deviation of each coefficient changes of each row
    scale: float = 1.0  # `kappa`, factor on the standard deviation of the noise

    def __len__(self) -> int:
        return len(self.noise_factor)

    def with_scale(self, scale: float) -> GaussianModel:
        """The same model with another factor on the noise; nothing is factorised again."""
        return self._sharing(self.columns, scale, _whitened=self._whitened, _spectrum=self._spectrum)

    def of_noise(self, columns: Floats, scale: float = 1.0) -> GaussianModel:
        """Other columns (n, q) with the same noise, at a scale of their own; the noise is not factorised again."""
        return self._sharing(columns, scale)

    def with_columns(self, columns: Floats) -> GaussianModel:
        """The same model with more columns (n, k) of normal coefficients."""
        whitened = np.column_stack([self._whitened, self._by_noise(columns)])
        return self._sharing(np.column_stack([self.columns, columns]), self.scale, _whitened=whitened)

    def _sharing(self, columns: Floats, scale: float, **known: Any) -> GaussianModel:
        """A model of the same noise, of which cached properties are known."""
        other = GaussianModel(self.noise_factor, columns, scale)
        other.__dict__.update(_noise=self._noise, **known)
        return other

    def rows(self, rows: Bools) -> GaussianModel:
        """The marginal distribution of some rows, (n,) bool."""
        if rows.all():
            return self
        noise = self.noise_factor[rows]
        factor: Floats = np.asarray(np.linalg.cholesky(noise @ noise.T), dtype=np.float64)
        return GaussianModel(factor, self.columns[rows], self.scale)

    @cached_property
    def covariance(self) -> Floats:
        """`S` (n, n)."""
        return self.noise_covariance + self.columns @ self.columns.T

    @property
    def noise_covariance(self) -> Floats:
        """`kappa^2 L L^T` (n, n)."""
        return self.scale**2 * self._noise.covariance

    def once(self, of: object, make: Callable[[], Made]) -> Made:
        """What is made of the noise, whatever its scale, and of an object; all models of the noise keep the last."""
        known = self._noise.made
        if known is None or known[0] is not of:
            known = self._noise.made = of, make()
        made: Made = known[1]
        return made

    @cached_property
    def _noise(self) -> _Noise:
        return _Noise(self.noise_factor)

    @cached_property
    def low_rank(self) -> Floats:
        """`Y` (k, n), with which `S^-1 = (L L^T)^-1 / kappa^2 - Y^T Y`."""
        weights = 1.0 / (self.scale * np.sqrt(self.scale**2 + self._spectrum.values))
        return np.asarray(self._spectrum.dual.T * weights[:, None])

    def noise_blocks(self, rows: Ints) -> Floats:
        """Covariance (g, d, d) of the noise of points with the rows (g, d)."""
        return self.scale**2 * self._noise.covariance[rows[:, :, None], rows[:, None, :]]

    def noise_precision(self, rows: Ints) -> Floats:
        """Rows (d, n) of `(L L^T)^-1 / kappa^2` by their numbers (d,)."""
        return np.asarray(self._noise.precision[rows] / self.scale**2)

    def precision_columns(self, rows: Ints) -> Floats:
        """Columns (n, d) of `S^-1` by their numbers (d,)."""
        Y = self.low_rank
        return np.asarray((self.noise_precision(rows) - Y[:, rows].T @ Y).T)

    def precision_blocks(self, rows: Ints) -> Floats:
        """Diagonal blocks (g, d, d) of `S^-1` of points with the rows (g, d)."""
        of_points = self.low_rank.T[rows]
        of_noise = self._noise.precision[rows[:, :, None], rows[:, None, :]] / self.scale**2
        return np.asarray(of_noise - of_points @ of_points.transpose(0, 2, 1))

    def precision_times(self, rows: Floats) -> Floats:
        """`S^-1` times rows (n,) or (n, b)."""
        return self.precision_at(rows)(self.scale)

    def precision_at(self, rows: Floats) -> Callable[[float], Floats]:
        """`S^-1` times rows (n,) or (n, b), as a function of the scale: what no scale changes is computed once."""
        values, B = self._spectrum.values, self._spectrum.dual
        of_noise, projected = rows.T @ self._noise.precision, rows.T @ B

        def times(scale: float) -> Floats:
            return np.asarray((of_noise - (projected / (scale**2 + values)) @ B.T) / scale**2).T

        return times

    @cached_property
    def _whitened(self) -> Floats:
        """`W = L^-1 U` (n, q)."""
        return self._by_noise(self.columns)

    @cached_property
    def _spectrum(self) -> _Spectrum:
        return _Spectrum(self.noise_factor, self._whitened)

    def _by_noise(self, rows: Floats) -> Floats:
        """`L^-1` of rows (n,) or (n, b)."""
        from scipy.linalg import solve_triangular

        return np.asarray(solve_triangular(self.noise_factor, rows, lower=True, check_finite=False))

    def whitened(self, rows: Floats) -> Floats:
        """Rows (n,) or (n, k) in coordinates in which the noise alone is `N(0, I)`: `L^-1 r / kappa`."""
        return self._by_noise(rows) / self.scale

    def standardised(self, rows: Floats) -> Floats:
        """Rows (n,) or (n, b) in coordinates in which the model is `N(0, I)`.

        `(kappa^2 I + W W^T)^(-1/2) L^-1 r`, whose products are those with `S^-1`.
        """
        return self.white(rows).standardised(self.scale).T

    def white(self, rows: Floats) -> WhiteRows:
        """Rows (n,) or (n, b), of which products at any scale are known."""
        # one row after the other in memory, as the solution has them
        white = self._by_noise(rows).T
        return WhiteRows(white, white @ self._spectrum.directions, self._spectrum.values, self._spectrum.directions)

    @cached_property
    def log_determinant(self) -> float:
        """`ln |S|`."""
        values = self._spectrum.values
        n, k2 = len(self), self.scale**2
        of_noise = 2.0 * float(np.log(np.diag(self.noise_factor)).sum())
        return of_noise + n * float(np.log(k2)) + float(np.log1p(values / k2).sum())

    def log_density(self, rows: Floats) -> Floats:
        """`ln N(r; 0, S)` of rows (n,) or (n, b): () or (b,)."""
        squares = np.sum(self.standardised(rows) ** 2, axis=0)
        return np.asarray(-0.5 * (squares + self.log_determinant + len(self) * np.log(2.0 * np.pi)))

    def log_density_of(self, rows: Floats, weighted: Floats) -> float:
        """`ln N(r; 0, S)` of rows (n,) of which `S^-1 r` (n,) is known."""
        return -0.5 * float(rows @ weighted + self.log_determinant + len(self) * np.log(2.0 * np.pi))

    def coefficients(self, rows: Floats) -> tuple[Floats, Floats]:
        """Mean (q,) and covariance (q, q) of the coefficients `xi` after rows (n,)."""
        W = self._whitened / self.scale
        covariance: Floats = np.asarray(np.linalg.inv(np.eye(W.shape[1]) + W.T @ W), dtype=np.float64)
        return covariance @ (W.T @ self._by_noise(rows)) / self.scale, covariance

    def log_marginal(self, rows: Floats, scales: Floats, log_prior: Floats) -> float:
        """Log density of rows (n,), summed over factors on the noise (k,) with the log of their prior probability."""
        return float(np.logaddexp.reduce(self._log_densities_at(rows, scales) + log_prior))

    def likely_scale(self, rows: Floats, scales: Floats, log_prior: Floats) -> float:
        """Mean of the factor on the noise after rows (n,); arguments as of `log_marginal`."""
        from scipy.special import softmax

        return float(softmax(self._log_densities_at(rows, scales) + log_prior) @ scales)

    def _log_densities_at(self, rows: Floats, scales: Floats) -> Floats:
        white = self.white(rows)
        squares = np.array([np.sum(white.standardised(scale) ** 2) for scale in scales.tolist()])
        determinants = np.array([self.with_scale(scale).log_determinant for scale in scales.tolist()])
        return -0.5 * (squares + determinants + len(self) * np.log(2.0 * np.pi))
