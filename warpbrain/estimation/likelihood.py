"""How likely residuals are: the noise of `warpbrain.inference`, its scale and its gross errors found by the fit itself.

The n numbers of all recordings have the covariance `kappa^2 R(w)`: independent noise and what neighbours share, a
factor that nobody knows exactly, and points whose noise is many times larger (`inference.noise`,
`inference.gross_errors`). About a fit everything is linear, with columns of one standard deviation of all that is
estimated: `w` and `kappa` are those that are most probable with these integrated out, and so is a standard deviation
that was not declared. The fit goes on with them until they stay as they are.
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
from warpbrain.inference.gross_errors import columns_of_inflation, noise_with_excess, with_gross_errors
from warpbrain.inference.noise import Outliers, log_scale_density, outliers, scales

#: An undeclared noise is no smaller [m] or [N]: below this it is rounding of the computation.
LEAST_SIGMA = 1e-9
#: Noise is found again this often at most, and until its size changes by less than this part.
_ROUNDS, _SETTLED = 6, 2e-4


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
    unresolved: float  # part of the change over an element that the mesh does not show
    outliers: Outliers | None  # what was believed of gross errors; None: there are none
    sound: GaussianModel  # of the noise at a scale of 1 if nothing is a gross error
    scale: float  # factor on all of it
    inflation: Floats  # (g,), how many times larger the noise of each point is: 1, or more of a gross error

    @classmethod
    def of(cls, rows: Sensors, sigma: Floats, unresolved: float, outliers: Outliers | None, scale: float) -> Noise:
        """Noise of rows that are all sound."""
        return cls(rows, sigma, unresolved, outliers, rows.noise(sigma, unresolved), scale, np.ones(len(rows.points)))

    @property
    def gross(self) -> Bools:
        """Points that are gross errors, shape (g,)."""
        return self.inflation > 1.0

    @cached_property
    def model(self) -> GaussianModel:
        """Of rows without anything that is estimated, at this scale and with these gross errors."""
        return self._model_at_one.with_scale(self.scale)

    @cached_property
    def _model_at_one(self) -> GaussianModel:
        if not self.gross.any():
            return self.sound
        return noise_with_excess(self.sound, columns_of_inflation(self.sound, self.rows.points, self.inflation))

    @cached_property
    def log_prior(self) -> float:
        """Of its scale and of its gross errors."""
        log_density = float(log_scale_density(np.array(self.scale)))
        if self.outliers is not None:
            kinds = np.searchsorted(self.outliers.inflations, self.inflation)
            log_density += float(self.outliers.log_probabilities[kinds].sum())
        return log_density

    @cached_property
    def deviation(self) -> Floats:
        """Of each number (n,), with what neighbours share and without gross errors."""
        return self.scale * np.sqrt(np.diag(self.sound.noise_covariance))

    def is_near(self, other: Noise) -> bool:
        """Whether another one has the same gross errors and nearly the same size."""
        sizes = np.abs(np.log(self.scale * self.sigma / (other.scale * other.sigma)))
        return bool(np.array_equal(self.inflation, other.inflation) and sizes.max() <= _SETTLED)

    def log_evidence(self, expected: Floats, columns: Floats) -> float:
        """`ln p` of residuals (n,) with columns (n, k) integrated out, and of the noise itself."""
        return float(self.model.with_columns(columns).log_density(expected)) + self.log_prior

    def with_gross_errors(self, expected: Floats, columns: Floats) -> Noise:
        """The same with the most probable gross errors; arguments as of `log_evidence`."""
        if self.outliers is None or not self.rows.points:
            return self
        model = self.sound.of_noise(columns, self.scale)
        inflation = with_gross_errors(model, expected, self.rows.points, self.outliers).inflation
        return self if np.array_equal(inflation, self.inflation) else replace(self, inflation=inflation)

    def with_likely_scale(self, expected: Floats, columns: Floats) -> Noise:
        """The same with the most probable factor on it."""
        low, *_, high = sorted(scales()[0].tolist())
        model = self.model.of_noise(columns)
        other = replace(self, scale=_likely_scale(model, expected, low, high, log_scale_density))
        other.__dict__["_model_at_one"] = self._model_at_one
        return other

    def with_likely_sigma(self, members: Bools, expected: Floats, columns: Floats) -> Noise:
        """The same with another size of a recording (n,) that declares none: the likeliest of its own rows."""
        model = self.model.of_noise(columns).rows(members)
        size = _likely_scale(model, expected[members], math.exp(-2.0), math.exp(2.0))
        likely = np.maximum(size / self.scale * self.sigma, LEAST_SIGMA)
        sigma = np.where(members, likely, self.sigma)
        other = Noise.of(self.rows, sigma, self.unresolved, self.outliers, self.scale)
        return replace(other, inflation=self.inflation)


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

    def noise(self, rows: Sensors, expected: Floats, columns: Floats) -> Noise:
        """The most probable noise about a fit.

        In the middle of the prior residuals are `expected` (n,), by the linear model about the fit, and one standard
        deviation of each number that is estimated changes them by `columns` (n, k).
        """
        unknown = np.isnan(rows.sigma)
        # where none is declared, relative to the others of the recording
        sigma = np.where(unknown, 1.0 / np.sqrt(rows.weights), rows.sigma)
        # rows (n,) of each recording
        members_of = [rows.recordings == number for number in np.unique(rows.recordings)]
        undeclared = [members for members in members_of if unknown[members].any()]
        left = expected
        for _ in range(2 if undeclared else 0):
            for members in undeclared:
                size = typical_size(left[members] / sigma[members], rows.groups[members])
                sigma[members] = np.maximum(size * sigma[members], LEAST_SIGMA)
            # a fit as rough as what is expected: what it leaves is where the search begins
            left = expected - columns @ GaussianModel(np.diag(sigma), columns).coefficients(expected)[0]

        def settled(noise: Noise) -> Noise:
            """Gross errors, undeclared noise and scale in turn until they stay."""
            for _ in range(_ROUNDS):
                last = noise
                noise = noise.with_gross_errors(expected, columns)
                for members in undeclared:
                    noise = noise.with_likely_sigma(members, expected, columns)
                if len(undeclared) < len(members_of):
                    noise = noise.with_likely_scale(expected, columns)
                if noise.is_near(last):
                    break
            return noise

        start = Noise.of(rows, sigma, 0.0, self.outliers, 1.0)
        # gross errors first, and all points sound first
        starts = [start] if self.outliers is None else [start, start.with_likely_scale(expected, columns)]
        best = max((settled(begun) for begun in starts), key=lambda noise: noise.log_evidence(expected, columns))
        if not rows.over_element.any() or self.outliers is None:
            return best
        for part in beliefs("mesh.unresolved")[1:].tolist():
            begun = Noise.of(rows, best.sigma, part, self.outliers, best.scale)
            other = settled(replace(begun, inflation=best.inflation))
            if other.log_evidence(expected, columns) < best.log_evidence(expected, columns):
                break
            best = other
        return best
