"""A normal distribution of recorded rows: correlated noise of an unknown scale, and columns with normal coefficients.

    r = U xi + kappa L eps,   xi, eps ~ N(0, I),   Cov r = S = kappa^2 L L^T + U U^T

With the eigenvectors of `(L^-1 U)^T (L^-1 U)` the square root of `S` is known for every `kappa`, at the cost of
products of n by q, the number of columns, which is smaller than the number n of rows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints

#: Rounding errors of eigenvalues of `W^T W`, in variances of the noise, with which singular values of `W` are computed.
_ROUNDED = 1e-3


class _Noise:
    """Covariance of the noise and its inverse: shared by models with the same noise, made when they are first used."""

    def __init__(self, factor: Floats) -> None:
        self._factor = factor

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


class _Whitened:
    """Columns (n, q) in coordinates in which the noise is `N(0, I)`: `W = L^-1 U`, and `L^-T W`."""

    def __init__(self, factor: Floats, columns: Floats) -> None:
        self._factor, self.columns = factor, columns

    @cached_property
    def dual(self) -> Floats:
        """`L^-T W` (n, q), with which the inverse of the covariance is made."""
        from scipy.linalg import solve_triangular

        return np.asarray(solve_triangular(self._factor, self.columns, lower=True, trans="T", check_finite=False))


class _Spectrum:
    """Eigenvalues (q,) of `W^T W`, and `W` times its eigenvectors (n, q): the same at all scales.

    Parameters
    ----------
    whitened : _Whitened
    lengths : (q,) array
        Factors on the columns.
    """

    def __init__(self, whitened: _Whitened, lengths: Floats) -> None:
        self._whitened = whitened
        W = whitened.columns * lengths
        values, vectors = np.linalg.eigh(W.T @ W)
        self.values, self.directions = np.maximum(values, 0.0), W @ vectors
        if np.finfo(np.float64).eps * values.max(initial=0.0) > _ROUNDED:
            # a column ten million times as long as the noise: its square has no digits left for the others
            left, sizes, right = np.linalg.svd(W, full_matrices=False)
            self.values, self.directions, vectors = sizes**2, left * sizes, right.T
        self._combinations = lengths[:, None] * vectors

    @cached_property
    def dual(self) -> Floats:
        """`L^-T` times the directions (n, q)."""
        return np.asarray(self._whitened.dual @ self._combinations)

    @cached_property
    def _products(self) -> dict[bytes, Floats]:
        return {}

    def products(self, rows: Ints) -> Floats:
        """Products of each two rows of `dual` of points with the rows (g, d), at all scales the same: (g d^2, q)."""
        key = rows.tobytes()
        if key not in self._products:
            B = self.dual[rows]
            self._products[key] = (B[:, :, None] * B[:, None, :]).reshape(-1, B.shape[2])
        return self._products[key]


@dataclass(frozen=True, eq=False)
class GaussianModel:
    """Rows with noise and normal coefficients.

    Parameters
    ----------
    noise_factor : (n, n) array
        Lower triangular factor `L` of the covariance of the noise.
    columns : (n, q) array
        `U`: what one standard deviation of each coefficient changes of each row.
    scale : float
        `kappa`, factor on the standard deviation of the noise.
    """

    noise_factor: Floats
    columns: Floats
    scale: float = 1.0

    def __len__(self) -> int:
        return len(self.noise_factor)

    def with_scale(self, scale: float) -> GaussianModel:
        """The same model with another factor on the noise; nothing is factorised again."""
        other = GaussianModel(self.noise_factor, self.columns, scale)
        other.__dict__["_noise"] = self._noise
        other.__dict__["_whitened"] = self._whitened
        other.__dict__["_lengths"] = self._lengths
        other.__dict__["_spectrum"] = self._spectrum
        return other

    def with_lengths(self, factors: Floats) -> GaussianModel:
        """The same model with columns so many times (q,) as long; nothing is whitened again."""
        other = GaussianModel(self.noise_factor, self.columns * factors, self.scale)
        other.__dict__["_noise"] = self._noise
        other.__dict__["_whitened"] = self._whitened
        other.__dict__["_lengths"] = self._lengths * factors
        return other

    def of_noise(self, columns: Floats) -> GaussianModel:
        """Other columns (n, q) with the same noise, at a scale of one; the noise is not factorised again."""
        other = GaussianModel(self.noise_factor, columns)
        other.__dict__["_noise"] = self._noise
        return other

    def with_columns(self, columns: Floats) -> GaussianModel:
        """The same model with more columns (n, k) of normal coefficients."""
        other = GaussianModel(self.noise_factor, np.column_stack([self.columns, columns]), self.scale)
        other.__dict__["_noise"] = self._noise
        whitened = np.column_stack([self._whitened_columns, self._by_noise(columns)])
        other.__dict__["_whitened"] = _Whitened(self.noise_factor, whitened)
        return other

    def rows(self, rows: Bools) -> GaussianModel:
        """The marginal distribution of some rows, (n,) bool."""
        noise = self.noise_factor[rows]
        factor: Floats = np.asarray(np.linalg.cholesky(noise @ noise.T), dtype=np.float64)
        return GaussianModel(factor, self.columns[rows], self.scale)

    @cached_property
    def covariance(self) -> Floats:
        """`S` (n, n)."""
        return self.scale**2 * self._noise.covariance + self.columns @ self.columns.T

    @cached_property
    def _noise(self) -> _Noise:
        return _Noise(self.noise_factor)

    @cached_property
    def _low_rank(self) -> tuple[Floats, Floats]:
        """`B` (n, q) and weights (q,) with which `S^-1 = ((L L^T)^-1 - B diag(weights) B^T) / kappa^2`."""
        return self._spectrum.dual, 1.0 / (self.scale**2 + self._spectrum.values)

    def noise_blocks(self, rows: Ints) -> Floats:
        """Covariance (g, d, d) of the noise of points with the rows (g, d)."""
        return np.asarray(self.scale**2 * self._noise.covariance[rows[:, :, None], rows[:, None, :]])

    def precision_columns(self, rows: Ints) -> Floats:
        """Columns (n, d) of `S^-1` by their numbers (d,)."""
        B, weights = self._low_rank
        return np.asarray((self._noise.precision[:, rows] - B @ (weights * B[rows]).T) / self.scale**2)

    def precision_blocks(self, rows: Ints) -> Floats:
        """Diagonal blocks (g, d, d) of `S^-1` of points with the rows (g, d)."""
        of_noise = self._noise.precision[rows[:, :, None], rows[:, None, :]]
        of_columns = (self._spectrum.products(rows) @ self._low_rank[1]).reshape(of_noise.shape)
        return np.asarray((of_noise - of_columns) / self.scale**2)

    def precision_times(self, rows: Floats) -> Floats:
        """`S^-1` times rows (n,) or (n, b)."""
        return next(self.precision_times_at([self.scale], rows))

    def precision_times_at(self, scales: Sequence[float], rows: Floats) -> Iterator[Floats]:
        """The same with each of some factors on the noise: what they have in common is computed once."""
        B, of_noise = self._spectrum.dual, self._noise.precision @ rows
        projected = B.T @ rows
        for scale in scales:
            weights = 1.0 / (scale**2 + self._spectrum.values)
            yield np.asarray((of_noise - B @ (weights * projected.T).T) / scale**2)

    @cached_property
    def _whitened(self) -> _Whitened:
        return _Whitened(self.noise_factor, self._by_noise(self.columns))

    @cached_property
    def _lengths(self) -> Floats:
        """Factors (q,) on the whitened columns."""
        return np.ones(self.columns.shape[1])

    @property
    def _whitened_columns(self) -> Floats:
        return self._whitened.columns * self._lengths

    @cached_property
    def _spectrum(self) -> _Spectrum:
        return _Spectrum(self._whitened, self._lengths)

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
        return next(self.standardised_at([self.scale], rows))

    def standardised_at(self, scales: Sequence[float], rows: Floats) -> Iterator[Floats]:
        """`standardised` rows with each of some factors on the noise: what they have in common is computed once."""
        values, directions = self._spectrum.values, self._spectrum.directions
        white = self._by_noise(rows)
        projected = directions.T @ white
        for scale in scales:
            root = np.sqrt(scale**2 + values)
            weights = 1.0 / (root * (root + scale))
            yield np.asarray((white - directions @ (weights * projected.T).T) / scale)

    @cached_property
    def log_determinant(self) -> float:
        """`ln |S|`."""
        return self._log_determinant(self.scale)

    def _log_determinant(self, scale: float) -> float:
        of_noise = 2.0 * float(np.log(np.diag(self.noise_factor)).sum())
        of_columns = float(np.log1p(self._spectrum.values / scale**2).sum())
        return of_noise + len(self) * float(np.log(scale**2)) + of_columns

    def log_density(self, rows: Floats) -> Floats:
        """`ln N(r; 0, S)` of rows (n,) or (n, b): () or (b,)."""
        return self.log_density_at([self.scale], rows)[0]

    def log_density_at(self, scales: Sequence[float], rows: Floats) -> Floats:
        """The same with each of some factors (k,) on the noise: (k,) or (k, b)."""
        logs = [
            -0.5 * (np.sum(white**2, axis=0) + self._log_determinant(scale) + len(self) * np.log(2.0 * np.pi))
            for scale, white in zip(scales, self.standardised_at(scales, rows), strict=True)
        ]
        return np.array(logs)

    def coefficients(self, rows: Floats) -> tuple[Floats, Floats]:
        """Mean (q,) and covariance (q, q) of the coefficients `xi` after rows (n,)."""
        W = self._whitened_columns / self.scale
        covariance: Floats = np.asarray(np.linalg.inv(np.eye(W.shape[1]) + W.T @ W), dtype=np.float64)
        return covariance @ (W.T @ self._by_noise(rows)) / self.scale, covariance

    def conditional(self, rows: Floats, observed: Bools) -> tuple[Floats, Floats]:
        """Distribution of the rows that were not observed given those that were.

        Parameters
        ----------
        rows : (n,) array
            Only the observed ones count.
        observed : (n,) bool array

        Returns
        -------
        mean, covariance : (m,), (m, m) arrays
            Of the others, their noise included.
        """
        S = self.covariance
        hidden = ~observed
        gain = np.linalg.solve(S[np.ix_(observed, observed)], S[np.ix_(observed, hidden)])
        covariance: Floats = S[np.ix_(hidden, hidden)] - S[np.ix_(hidden, observed)] @ gain
        return gain.T @ rows[observed], covariance

    def log_density_of_hidden(self, rows: Floats, observed: Bools) -> float:
        """`ln p(r_hidden | r_observed)`: the joint log density less that of the observed rows."""
        return float(self.log_density(rows)) - float(self.rows(observed).log_density(rows[observed]))

    def draws(self, count: int, random: np.random.Generator) -> Floats:
        """Rows (n, count) drawn from the model."""
        noise = self.noise_factor @ random.normal(size=(len(self), count))
        return np.asarray(self.scale * noise + self.columns @ random.normal(size=(self.columns.shape[1], count)))

    def log_marginal(self, rows: Floats, scales: Floats, log_prior: Floats) -> float:
        """Log density of rows (n,), summed over factors on the noise (k,) with the log of their prior probability."""
        return float(np.logaddexp.reduce(self.log_density_at(scales.tolist(), rows) + log_prior))

    def likely_scale(self, rows: Floats, scales: Floats, log_prior: Floats) -> float:
        """Mean of the factor on the noise after rows (n,); arguments as of `log_marginal`."""
        from scipy.special import softmax

        return float(softmax(self.log_density_at(scales.tolist(), rows) + log_prior) @ scales)
