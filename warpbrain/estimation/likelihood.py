"""How likely residuals are: the noise of `warpbrain.inference`, its scale and its gross errors found by the fit itself.

The n numbers of all recordings have the covariance `kappa^2 R(w)`: independent noise and what neighbours share, a
factor that nobody knows exactly, and points whose noise is many times larger (`inference.noise`,
`inference.gross_errors`). About a fit everything is linear, with columns of one standard deviation of all that is
estimated: `w` and `kappa` are those that are most probable with these integrated out, and so is a standard deviation
that was not declared. The fit goes on with them until they stay as they are.

Far from the estimate most of a residual is no noise yet. There each recording's noise is taken to be independent and as
large as its residuals are, but no less than declared.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.estimation.observations import Sensors
from warpbrain.inference.beliefs import beliefs
from warpbrain.inference.gaussian import GaussianModel
from warpbrain.inference.gross_errors import with_gross_errors
from warpbrain.inference.noise import Outliers, log_scale_density, noise_factor, outliers, scales
from warpbrain.recordings.comparison import root_mean_square

#: An undeclared noise is no smaller [m] or [N]: below this it is rounding of the computation.
LEAST_SIGMA = 1e-9
#: Noise is found again this often at most, and until its size changes by less than this part.
_ROUNDS, _SETTLED = 6, 2e-4


def _beginnings(rows: Sensors) -> tuple[Floats, list[Bools], list[Bools]]:
    """Standard deviation (n,) of each row, where none is declared relative to the others of the recording.

    And the rows (n,) of each recording that declares it, and of each that does not.
    """
    undeclared = np.isnan(rows.sigma)
    members = [rows.recordings == number for number in np.unique(rows.recordings)]
    sigma = np.where(undeclared, 1.0 / np.sqrt(rows.weights), rows.sigma)
    return sigma, [m for m in members if not undeclared[m].any()], [m for m in members if undeclared[m].any()]


def typical_size(numbers: Floats, groups: Ints) -> float:
    """Standard deviation of numbers (n,) of which few are gross errors, by the median length of points.

    In any axes the same, which that of components is not. `groups` (n,): the point of each number.
    """
    from scipy.special import chdtri

    counts = np.bincount(groups)
    squares = np.bincount(groups, numbers**2)[counts > 0]
    return float(np.sqrt(np.median(squares / chdtri(counts[counts > 0], 0.5))))


@dataclass(frozen=True, eq=False)
class Noise:
    """What the noise of residuals is, with everything that is estimated integrated out."""

    rows: Sensors
    sigma: Floats  # (n,), of the independent part of each number, at a scale of 1
    scale: float  # factor on all of it
    inflation: Floats  # (g,), how many times larger the noise of each point is: 1, or more of a gross error
    outliers: Outliers | None  # what was believed of them; None: there are none
    unresolved: float = 0.0  # part of the change over an element that the mesh does not show

    @property
    def gross(self) -> Bools:
        """Points that are gross errors, shape (g,)."""
        return self.inflation > 1.0

    @cached_property
    def _covariance(self) -> Floats:
        """Of the noise at a scale of 1 (n, n), without gross errors."""
        return self.rows.noise_covariance(self.sigma, self.unresolved * self.rows.over_element)

    @cached_property
    def factor(self) -> Floats:
        """Lower factor (n, n) of the covariance at a scale of 1, with gross errors in it."""
        covariance = self._covariance.copy()
        for number in np.flatnonzero(self.gross).tolist():
            numbers = self.rows.points[number]
            covariance[np.ix_(numbers, numbers)] *= self.inflation[number] ** 2
        return noise_factor(covariance, self.sigma)

    @cached_property
    def log_prior(self) -> float:
        """Of its scale and of its gross errors."""
        log_density = float(log_scale_density(np.array(self.scale)))
        if self.outliers is not None:
            kinds = np.searchsorted(self.outliers.inflations, self.inflation)
            log_density += float(self.outliers.log_probabilities[kinds].sum())
        return log_density

    @cached_property
    def _model(self) -> GaussianModel:
        return GaussianModel(self.factor, np.zeros((len(self.rows), 0)), self.scale)

    def negative_log(self, residual: Floats) -> float:
        """`-ln p` of residuals (n,), with that of the noise itself."""
        return -float(self._model.log_density(residual)) - self.log_prior

    def standardised(self, numbers: Floats) -> Floats:
        """Numbers (n, ...) in coordinates in which noise is independent and of unit variance."""
        return self._model.whitened(numbers)

    @cached_property
    def deviation(self) -> Floats:
        """Of each number (n,), with what neighbours share and without gross errors."""
        return self.scale * np.sqrt(np.diag(self._covariance))

    def is_near(self, other: Noise) -> bool:
        """Whether another one has the same gross errors and nearly the same size."""
        sizes = np.abs(np.log(self.scale * self.sigma / (other.scale * other.sigma)))
        return bool(np.array_equal(self.inflation, other.inflation) and sizes.max() <= _SETTLED)

    def log_evidence(self, expected: Floats, columns: Floats) -> float:
        """`ln p` of residuals (n,) with columns (n, k) integrated out, and of the noise itself."""
        return float(self._model.with_columns(columns).log_density(expected)) + self.log_prior

    def with_gross_errors(self, expected: Floats, columns: Floats) -> Noise:
        """The same with the most probable gross errors; arguments as of `log_evidence`."""
        if self.outliers is None or not self.rows.points:
            return self
        sound = self._but(self.scale, np.ones_like(self.inflation))
        model = sound._model.with_columns(columns)
        inflation = with_gross_errors(model, expected, self.rows.points, self.outliers).inflation
        return self if np.array_equal(inflation, self.inflation) else sound._but(self.scale, inflation)

    def with_likely_scale(self, expected: Floats, columns: Floats) -> Noise:
        """The same with the most probable factor on it."""
        low, *_, high = sorted(scales()[0].tolist())
        model = self._model.of_noise(columns)
        return self._but(_likely_scale(model, expected, low, high, log_scale_density), self.inflation)

    def _but(self, scale: float, inflation: Floats) -> Noise:
        """The same of another scale, or with other gross errors: what neither changes is not made again."""
        other = replace(self, scale=scale, inflation=inflation)
        other.__dict__["_covariance"] = self._covariance
        if np.array_equal(other.inflation, self.inflation):
            other.__dict__["factor"] = self.factor
            other.__dict__["_model"] = self._model.of_noise(self._model.columns, other.scale)
        return other

    def with_likely_sigma(self, members: Bools, expected: Floats, columns: Floats) -> Noise:
        """The same with another size of a recording (n,) that declares none: the likeliest of its own rows."""
        model = self._model.of_noise(columns).rows(members)
        size = _likely_scale(model, expected[members], math.exp(-2.0), math.exp(2.0))
        likely = np.maximum(size / self.scale * self.sigma, LEAST_SIGMA)
        return replace(self, sigma=np.where(members, likely, self.sigma))


class IndependentNoise(Noise):
    """Independent noise, sound and of a scale of 1, for the way to the estimate."""

    @classmethod
    def as_large_as(cls, rows: Sensors) -> IndependentNoise:
        """As large as the residuals of each recording are, but no less than declared."""
        sigma, declared, undeclared = _beginnings(rows)
        for each, least in ((declared, 1.0), (undeclared, LEAST_SIGMA)):
            for members in each:
                sigma[members] *= max(root_mean_square(rows.residual[members] / sigma[members]), least)
        return cls(rows, sigma, 1.0, np.ones(len(rows.points)), None)

    def negative_log(self, residual: Floats) -> float:
        """`-ln p` of residuals (n,), up to a constant."""
        return float(np.sum(np.log(self.sigma) + 0.5 * self.standardised(residual) ** 2))

    def standardised(self, numbers: Floats) -> Floats:
        """Numbers (n, ...) in units of the noise."""
        return np.asarray((numbers.T / self.sigma).T)


def _likely_scale(
    model: GaussianModel, rows: Floats, low: float, high: float, log_prior: Callable[[Floats], Floats] = np.zeros_like
) -> float:
    """The most probable factor on the noise of rows (n,), between two."""
    from scipy.optimize import minimize_scalar

    def negative(log_scale: float) -> float:
        scale = math.exp(log_scale)
        return -float(model.with_scale(scale).log_density(rows)) - float(log_prior(np.array(scale)))

    bounds = math.log(low), math.log(high)
    return math.exp(minimize_scalar(negative, bounds=bounds, method="bounded", options={"xatol": 1e-5}).x)


@dataclass(frozen=True)
class Likelihood:
    """What is believed of noise; `outliers`: of gross errors, None if nothing is one."""

    outliers: Outliers | None = field(default_factory=outliers)

    def noise(self, rows: Sensors, left: Floats, expected: Floats, columns: Floats) -> Noise:
        """The most probable noise about a fit, which leaves residuals `left` (n,).

        In the middle of the prior they are `expected` (n,), by the linear model about the fit, and one standard
        deviation of each number that is estimated changes them by `columns` (n, k).
        """
        sigma, declared, undeclared = _beginnings(rows)
        for members in undeclared:
            size = typical_size(left[members] / sigma[members], rows.groups[members])
            sigma[members] *= max(size, LEAST_SIGMA)

        def settled(noise: Noise) -> Noise:
            """Gross errors, undeclared noise and scale in turn until they stay."""
            for _ in range(_ROUNDS):
                last = noise
                noise = noise.with_gross_errors(expected, columns)
                for members in undeclared:
                    noise = noise.with_likely_sigma(members, expected, columns)
                if declared:
                    noise = noise.with_likely_scale(expected, columns)
                if noise.is_near(last):
                    break
            return noise

        start = Noise(rows, sigma, 1.0, np.ones(len(rows.points)), self.outliers)
        # gross errors first, and all points sound first
        starts = [start] if self.outliers is None else [start, start.with_likely_scale(expected, columns)]
        best = max((settled(begun) for begun in starts), key=lambda noise: noise.log_evidence(expected, columns))
        if not rows.over_element.any() or self.outliers is None:
            return best
        for part in beliefs("mesh.unresolved")[1:].tolist():
            other = settled(replace(best, unresolved=part))
            if other.log_evidence(expected, columns) < best.log_evidence(expected, columns):
                break
            best = other
        return best
