"""Points whose noise is far larger than declared, such as mispaired landmarks: each hypothesis pays for its own.

With the indicator `w_i` of point i its noise is W times as large: the covariance of its rows grows by
`Delta_i = (W^2 - 1) kappa^2 (L L^T)_ii`. Seen from all other rows, given the indicators of the other points,

    ln p(r | w_i = 1) / p(r | w_i = 0) = v^T (Delta_i^-1 + P_ii)^-1 v / 2 - ln |I + Delta_i P_ii| / 2

with `v = (S^-1 r)_i` and `P_ii = (S^-1)_ii`. What one hypothesis takes for gross errors is what another one explains,
so nothing is set aside before a hypothesis is asked.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.inference.gaussian import GaussianModel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Outliers:
    """Prior of gross errors.

    Parameters
    ----------
    probability : float
        That a point is one.
    inflation : float
        `W`, factor on the standard deviation of its noise.
    """

    probability: float
    inflation: float


@dataclass(frozen=True, eq=False)
class GrossErrors:
    """Gross errors under one hypothesis.

    Attributes
    ----------
    log_density : float
        Log density of the rows, summed over the indicators: each by itself about the most probable of all of them.
    log_odds : (g,) array
        Of each point to be a gross error, given the others.
    """

    log_density: float
    log_odds: Floats


def with_gross_errors(
    model: GaussianModel, residual: Floats, points: Sequence[Ints], prior: Outliers, sweeps: int = 10
) -> GrossErrors:
    """Density of residuals where some points may be gross errors.

    Parameters
    ----------
    model : GaussianModel
        Of the rows (n,) under the hypothesis, its causes among the columns.
    residual : (n,) array
        Less what is expected of the causes.
    points : sequence of int arrays
        Rows of each point; rows of none are never gross errors.
    prior : Outliers
    sweeps : int
        Passes over the points at most. The point whose odds change sides the most goes first.
    """
    search = _Search(model, residual, points, prior)
    for _ in range(sweeps * max(len(points), 1)):
        odds = search.log_odds()
        wrong = np.where((odds > 0.0) != search.gross, np.abs(odds), 0.0)
        if not wrong.any():
            break
        search.flip(int(np.argmax(wrong)))
    count = int(np.count_nonzero(search.gross))
    log_indicators = count * np.log(prior.probability) + (len(points) - count) * np.log1p(-prior.probability)
    others = np.log1p(np.exp(-np.abs(odds))).sum()
    return GrossErrors(float(search.log_density() + log_indicators + others), odds)


def columns_of_gross_errors(
    model: GaussianModel, points: Sequence[Ints], gross: NDArray[np.bool_], prior: Outliers
) -> Floats:
    """Columns (n, k) of normal coefficients by which the noise of points that are gross errors (g,) is larger."""
    found = [np.zeros((len(model), 0))]
    for number in np.flatnonzero(gross).tolist():
        columns = np.zeros((len(model), len(points[number])))
        columns[points[number]] = np.linalg.cholesky(_added(model, points[number][None], prior)[0])
        found.append(columns)
    return np.concatenate(found, axis=1)


def _added(model: GaussianModel, rows: Ints, prior: Outliers) -> Floats:
    """`Delta` (g, d, d) of points with the rows (g, d)."""
    return (prior.inflation**2 - 1.0) * model.noise_blocks(rows)


@dataclass(frozen=True, eq=False)
class _Alike:
    """Points of equally many rows: their numbers (g,), rows (g, d), `Delta` (g, d, d), and `P_ii` of all sound."""

    numbers: Ints
    rows: Ints
    added: Floats
    precision: Floats


class _Search:
    """Points that are gross errors, and the inverse of the covariance with them, as updates of that with none.

    With the rows R of all gross errors, `P = P_0 - P_0[:, R] (Delta_R^-1 + P_0[R, R])^-1 P_0[R, :]` (Woodbury).
    """

    def __init__(self, model: GaussianModel, residual: Floats, points: Sequence[Ints], prior: Outliers) -> None:
        self.gross = np.zeros(len(points), dtype=bool)
        self._model, self._points, self._prior = model, points, prior
        sizes = np.array([len(rows) for rows in points], dtype=np.int64)
        self._alike = []
        for size in np.unique(sizes).tolist():
            numbers = np.flatnonzero(sizes == size)
            rows = np.array([points[number] for number in numbers.tolist()])
            self._alike.append(_Alike(numbers, rows, _added(model, rows, prior), model.precision_blocks(rows)))
        self._weighted = model.precision_times(residual)
        self._log_sound = float(model.log_density(residual))
        # of points that have been gross errors: columns of the inverse, the inverse of what is added and its volume
        self._once: dict[int, tuple[Floats, Floats, float]] = {}
        self._update()

    def flip(self, number: int) -> None:
        """Let a point be a gross error if it is none, or none if it is one."""
        self.gross[number] = not self.gross[number]
        if number not in self._once:
            rows = self._points[number]
            added = _added(self._model, rows[None], self._prior)[0]
            columns = self._model.precision_columns(rows)
            self._once[number] = columns, np.asarray(np.linalg.inv(added)), float(np.linalg.slogdet(added)[1])
        self._update()

    def _update(self) -> None:
        """Factor of `Delta_R^-1 + P_0[R, R]`, and its inverse times `P_0[R, :]` and `(P_0 r)_R`."""
        from scipy.linalg import solve_triangular

        numbers = np.flatnonzero(self.gross).tolist()
        R = np.concatenate([np.zeros(0, dtype=np.int64), *(self._points[number] for number in numbers)])
        columns = np.concatenate([np.zeros((len(self._model), 0)), *(self._once[k][0] for k in numbers)], axis=1)
        inner, at = columns[R], 0
        for number in numbers:
            size = len(self._points[number])
            inner[at : at + size, at : at + size] += self._once[number][1]
            at += size
        factor = np.linalg.cholesky(inner)
        both = np.column_stack([columns.T, self._weighted[R]])
        solved = solve_triangular(factor, both, lower=True, check_finite=False) if numbers else both
        self._seen, self._residual = solved[:, :-1].T, solved[:, -1]
        self._log_volume = sum(self._once[k][2] for k in numbers) + 2.0 * float(np.log(np.diag(factor)).sum())

    def log_odds(self) -> Floats:
        """Of each point (g,) to be a gross error, given the others."""
        log_prior_odds = np.log(self._prior.probability) - np.log1p(-self._prior.probability)
        weighted = self._weighted - self._seen @ self._residual
        odds = np.empty(len(self.gross))
        for alike in self._alike:
            seen = self._seen[alike.rows]
            P = alike.precision - seen @ np.swapaxes(seen, 1, 2)
            there = self.gross[alike.numbers]
            odds[alike.numbers] = log_prior_odds + _log_ratios(weighted[alike.rows], P, alike.added, there)
        return odds

    def log_density(self) -> float:
        """Of the rows, with the gross errors that there are."""
        return self._log_sound + 0.5 * float(self._residual @ self._residual) - 0.5 * self._log_volume


def _log_ratios(v: Floats, P: Floats, added: Floats, there: NDArray[np.bool_]) -> Floats:
    """Log densities (g,) with larger noise of a point less those without, from the inverse covariance as it is now."""
    sign = np.where(there, -1.0, 1.0)
    times = sign[:, None, None] * added
    middle = np.linalg.solve(np.eye(v.shape[1]) + times @ P, times)
    squares = np.einsum("gi,gij,gj->g", v, middle, v)
    volume = np.linalg.slogdet(np.eye(v.shape[1]) + times @ P)[1]
    return np.asarray(sign * (0.5 * squares - 0.5 * volume))
