"""How likely residuals are: the noise of `warpbrain.inference`, its scale and its gross errors found by the fit itself.

The n numbers of all recordings, one after the other, have the covariance `kappa^2 R(w)`: independent noise and what
neighbours share, a factor that nobody knows exactly, and points whose noise is many times larger
(`inference.noise`, `inference.gross_errors`). About a fit everything is linear, with columns of one standard deviation
of all that is estimated: `w` and `kappa` are those that are most probable with these integrated out, and so is a
standard deviation that was not declared. The fit goes on with them until they stay as they are.

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
from warpbrain.estimation.observations import Observations, Residuals
from warpbrain.inference.beliefs import beliefs
from warpbrain.inference.gaussian import GaussianModel
from warpbrain.inference.gross_errors import Outliers, with_gross_errors
from warpbrain.inference.noise import log_scale_density, noise_covariance, outliers, scales
from warpbrain.recordings.agreement import root_mean_square

#: An undeclared noise is no smaller [m] or [N]: below this it is rounding of the computation.
LEAST_SIGMA = 1e-9
#: Noise is found again this often at most, and until its size changes by less than this part.
_ROUNDS, _SETTLED = 6, 0.02


@dataclass(frozen=True, eq=False)
class Rows:
    """The numbers of all recordings, one after the other.

    Attributes
    ----------
    positions, directions : (n, 3) array
        As of `noise_covariance`.
    sigma : (n,) array
        Declared; where it is to be estimated, relative to the others of the recording.
    recordings : (n,) int array
        Number of the recording.
    declared : (m,) bool array
        Of which recordings the noise is known.
    points : tuple of int arrays
        Rows of each point that may be a gross error, those of a recording together; forces have none.
    times : (n,) array, optional
        When [s]; all at the end unless given.
    over_element : (n, 3) array, optional
        As of `noise_covariance`; zero unless given.
    unresolved : float
        Part of it that the mesh does not show.
    """

    positions: Floats
    directions: Floats
    sigma: Floats
    recordings: Ints
    declared: Bools
    points: tuple[Ints, ...]
    times: Floats | None = None
    over_element: Floats | None = None
    unresolved: float = 0.0

    @classmethod
    def of(cls, observations: Observations, parts: tuple[Residuals, ...]) -> Rows:
        """Those of residuals at a state: surfaces are looked at along their normals there."""
        positions, sigma, points, times, first = [], [], [], [], 0
        for recording in observations.recordings:
            count = len(recording.rows)
            where = recording.positions if len(recording.positions) else np.full((count, 3), np.nan)
            positions.append(np.repeat(where, recording.size, axis=0))
            deviation = 1.0 / np.sqrt(recording.weights) if recording.sigma is None else recording.sigma
            sigma.append(np.repeat(deviation, recording.size))
            times.append(np.repeat(recording.times, recording.size))
            numbers = first + np.arange(count * recording.size).reshape(count, recording.size)
            points += list(numbers) if recording.unit == "m" else []
            first += count * recording.size
        sizes = [part.values.size for part in parts]
        return cls(
            np.concatenate(positions),
            np.concatenate([part.directions.reshape(-1, 3) for part in parts]),
            np.concatenate(sigma),
            np.repeat(np.arange(len(parts)), sizes),
            np.array([recording.sigma is not None for recording in observations.recordings]),
            tuple(points),
            np.concatenate(times),
            np.concatenate([recording.over_element.reshape(-1, 3) for recording in observations.recordings]),
        )

    def covariance(self, sigma: Floats) -> Floats:
        """Of the noise at a scale of 1, (n, n), with standard deviations (n,)."""
        times = np.full(len(sigma), np.inf) if self.times is None else self.times
        beyond = None if self.over_element is None else self.unresolved * self.over_element
        return noise_covariance(self.positions, self.directions, times, sigma, beyond)


@dataclass(frozen=True, eq=False)
class IndependentNoise:
    """Independent noise with standard deviations (n,), for the way to the estimate."""

    sigma: Floats

    @classmethod
    def as_large_as(cls, rows: Rows, residual: Floats) -> IndependentNoise:
        """As large as the residuals (n,) of each recording are, but no less than declared."""
        sigma = rows.sigma.copy()
        for number, declared in enumerate(rows.declared.tolist()):
            members = rows.recordings == number
            sigma[members] *= max(
                root_mean_square(residual[members] / sigma[members]), 1.0 if declared else LEAST_SIGMA
            )
        return cls(sigma)

    def negative_log(self, residual: Floats) -> float:
        """`-ln p` of residuals (n,)."""
        return float(np.sum(np.log(self.sigma) + 0.5 * self.standardised(residual) ** 2))

    def standardised(self, numbers: Floats) -> Floats:
        """Numbers (n, ...) in units of the noise."""
        return np.asarray((numbers.T / self.sigma).T)


@dataclass(frozen=True, eq=False)
class Noise:
    """What the noise of residuals is, with everything that is estimated integrated out.

    Attributes
    ----------
    rows : Rows
    sigma : (n,) array
        Standard deviation of the independent part of each number, at a scale of 1.
    scale : float
        Factor on all of it.
    inflation : (g,) array
        How many times larger the noise of each point is: 1 of a sound one, more of a gross error.
    outliers : Outliers or None
        What was believed of them; None: there are none.
    """

    rows: Rows
    sigma: Floats
    scale: float
    inflation: Floats
    outliers: Outliers | None

    @property
    def gross(self) -> Bools:
        """Which points (g,) are gross errors."""
        return self.inflation > 1.0

    @cached_property
    def factor(self) -> Floats:
        """Lower triangular factor (n, n) of the covariance at a scale of 1, gross errors in it."""
        covariance = self.rows.covariance(self.sigma)
        for number in np.flatnonzero(self.gross).tolist():
            numbers = self.rows.points[number]
            covariance[np.ix_(numbers, numbers)] *= self.inflation[number] ** 2
        # metres beside newtons: one size for all
        return np.asarray(
            self.sigma[:, None] * np.linalg.cholesky(covariance / np.outer(self.sigma, self.sigma)), dtype=np.float64
        )

    @cached_property
    def log_prior(self) -> float:
        """Of its scale and of its gross errors."""
        log_density = float(log_scale_density(np.array(self.scale)))
        if self.outliers is not None:
            kinds = np.searchsorted(self.outliers.inflations, self.inflation)
            log_density += float(self.outliers.log_probabilities[kinds].sum())
        return log_density

    def negative_log(self, residual: Floats) -> float:
        """`-ln p` of residuals (n,), with that of the noise itself."""
        n = len(residual)
        volume = float(np.log(np.diag(self.factor)).sum()) + n * math.log(math.sqrt(2.0 * math.pi) * self.scale)
        return 0.5 * float(np.sum(self.standardised(residual) ** 2)) + volume - self.log_prior

    def standardised(self, numbers: Floats) -> Floats:
        """Numbers (n, ...) in coordinates in which noise is independent and of unit variance."""
        from scipy.linalg import solve_triangular

        return np.asarray(solve_triangular(self.factor, numbers, lower=True, check_finite=False) / self.scale)

    def of_recording(self, number: int, shape: tuple[int, ...]) -> tuple[Floats, Floats, Bools]:
        """Of a recording of n rows of d numbers, without gross errors.

        Returns
        -------
        sigma : (n,) array
            Standard deviation of the independent part of one component.
        deviation : (n, d) array
            With what neighbours share.
        gross : (n,) bool array
            Rows that are gross errors.
        """
        members = self.rows.recordings == number
        gross = [wrong for rows, wrong in zip(self.rows.points, self.gross.tolist(), strict=True) if members[rows[0]]]
        return (
            self.scale * self.sigma[members].reshape(shape)[:, 0],
            self._deviation[members].reshape(shape),
            np.array(gross or np.zeros(shape[0]), dtype=bool),
        )

    @cached_property
    def _deviation(self) -> Floats:
        """Of each number (n,), with what neighbours share and without gross errors."""
        return self.scale * np.sqrt(np.diag(self.rows.covariance(self.sigma)))

    def is_near(self, other: Noise) -> bool:
        """Whether another one has the same gross errors and nearly the same size."""
        sizes = np.abs(np.log(self.scale * self.sigma / (other.scale * other.sigma)))
        return bool(np.array_equal(self.inflation, other.inflation) and sizes.max() <= _SETTLED)


@dataclass(frozen=True)
class Likelihood:
    """What is believed of noise.

    Parameters
    ----------
    outliers : Outliers or None
        None: nothing is a gross error.
    """

    outliers: Outliers | None = field(default_factory=outliers)

    def noise(self, rows: Rows, left: Floats, expected: Floats, columns: Floats) -> Noise:
        """The most probable noise about a fit.

        Parameters
        ----------
        rows : Rows
        left : (n,) array
            What the fit leaves.
        expected : (n,) array
            Residuals in the middle of the prior, by the linear model about the fit.
        columns : (n, k) array
            What one standard deviation of each number that is estimated changes.
        """
        sound = np.ones(len(rows.points))
        sigma = rows.sigma.copy()
        for number in np.flatnonzero(~rows.declared).tolist():
            members = rows.recordings == number
            # few of them are gross errors
            sigma[members] *= max(1.4826 * float(np.median(np.abs(left[members] / sigma[members]))), LEAST_SIGMA)
        candidates = [
            self._settled(Noise(rows, sigma, scale, sound, self.outliers), expected, columns)
            for scale in self._starts(rows, sigma, expected, columns)
        ]
        found = max(candidates, key=lambda noise: _log_evidence(noise, expected, columns))
        if rows.over_element is None or not rows.over_element.any() or self.outliers is None:
            return found
        for part in beliefs("mesh.unresolved")[1:].tolist():
            other = self._settled(replace(found, rows=replace(rows, unresolved=part)), expected, columns)
            if _log_evidence(other, expected, columns) < _log_evidence(found, expected, columns):
                break
            found = other
        return found

    def _starts(self, rows: Rows, sigma: Floats, expected: Floats, columns: Floats) -> tuple[float, ...]:
        """Scales to begin with: gross errors first, and all points sound first."""
        if self.outliers is None:
            return (1.0,)
        sound = Noise(rows, sigma, 1.0, np.ones(len(rows.points)), self.outliers)
        return 1.0, _likely_scale(sound, expected, columns)

    def _settled(self, noise: Noise, expected: Floats, columns: Floats) -> Noise:
        """Gross errors, undeclared noise and scale in turn until they stay."""
        for _ in range(_ROUNDS):
            last = noise
            if self.outliers is not None and len(noise.rows.points):
                sound = replace(noise, inflation=np.ones_like(noise.inflation))
                model = GaussianModel(sound.factor, columns, noise.scale)
                with_errors = with_gross_errors(model, expected, noise.rows.points, self.outliers)
                noise = replace(noise, inflation=with_errors.inflation)
            for number in np.flatnonzero(~noise.rows.declared).tolist():
                noise = _with_likely_sigma(noise, number, expected, columns)
            if noise.rows.declared.any():
                noise = replace(noise, scale=_likely_scale(noise, expected, columns))
            if noise.is_near(last):
                break
        return noise


def _log_evidence(noise: Noise, expected: Floats, columns: Floats) -> float:
    return float(GaussianModel(noise.factor, columns, noise.scale).log_density(expected)) + noise.log_prior


def _likely_scale(noise: Noise, expected: Floats, columns: Floats) -> float:
    """The most probable scale with the gross errors that there are."""
    model = GaussianModel(noise.factor, columns)

    def negative(log_scale: float) -> float:
        scale = math.exp(log_scale)
        return -float(model.with_scale(scale).log_density(expected)) - float(log_scale_density(np.array(scale)))

    values, _ = scales()
    return math.exp(_least(negative, math.log(values.min()), math.log(values.max())))


def _with_likely_sigma(noise: Noise, number: int, expected: Floats, columns: Floats) -> Noise:
    """The noise with another size of that of a recording which declares none: the likeliest of its own rows."""
    members = noise.rows.recordings == number
    model = GaussianModel(noise.factor, columns).rows(members)

    def negative(log_size: float) -> float:
        return -float(model.with_scale(math.exp(log_size)).log_density(expected[members]))

    size = math.exp(_least(negative, -2.0, 2.0)) / noise.scale
    sigma = noise.sigma.copy()
    sigma[members] = np.maximum(size * sigma[members], LEAST_SIGMA)
    return replace(noise, sigma=sigma)


def _least(function: Callable[[float], float], low: float, high: float) -> float:
    from scipy.optimize import minimize_scalar

    return float(minimize_scalar(function, bounds=(low, high), method="bounded", options={"xatol": 1e-4}).x)
