"""Points whose noise is far larger than declared, such as mispaired landmarks: each hypothesis pays for its own.

The noise of point i is `w_i` times as large, 1 or one of few inflations: the covariance of its rows is larger by
`Delta_i = (w_i^2 - 1) kappa^2 (L L^T)_ii`. Given all other rows and the
inflations of the other points, another inflation, which changes it by `D_i`, has

    ln p(r | w_i') / p(r | w_i) = v^T (I + D_i P_ii)^-1 D_i v / 2 - ln |I + D_i P_ii| / 2

with `v = (S^-1 r)_i` and `P_ii = (S^-1)_ii`. Points that are gross errors under one hypothesis may be explained
by another, so no point is discarded before hypotheses are compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpbrain.arrays import Floats, Ints
from warpbrain.inference.gaussian import GaussianModel


@dataclass(frozen=True)
class Outliers:
    """Prior of gross errors.

    Parameters
    ----------
    probability : float
        That a point is one.
    inflation : float
        Factor on the standard deviation of its noise.
    further : tuple of float
        Further factors, all equally probable: with a single one a point that is much farther off still has influence.
    """

    probability: float
    inflation: float
    further: tuple[float, ...] = ()

    @property
    def inflations(self) -> Floats:
        """Of a sound point, which is 1, and of a gross error, shape (1 + k,)."""
        return np.array([1.0, self.inflation, *self.further])

    @property
    def log_probabilities(self) -> Floats:
        """Of each of them, shape (1 + k,)."""
        count = 1 + len(self.further)
        return np.log(np.array([1.0 - self.probability, *[self.probability / count] * count]))


@dataclass(frozen=True, eq=False)
class GrossErrors:
    """Gross errors under one hypothesis.

    Attributes
    ----------
    log_density : float
        Log density of the rows, summed over the inflation of each point with all others at their most probable ones.
    log_odds : (g,) array
        Of each point to be a gross error, given the others.
    inflation : (g,) array
        The most probable one of each point, 1 of a sound one.
    """

    log_density: float
    log_odds: Floats
    inflation: Floats


def with_gross_errors(
    model: GaussianModel,
    residual: Floats,
    points: Sequence[Ints],
    prior: Outliers,
    sweeps: int = 10,
    start: Floats | None = None,
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
    start : (g,) array, optional
        The most probable inflation of each point under a hypothesis that is nearly the same; all are sound by default.
    """
    search = _Search(model, residual, points, prior)
    if start is not None and (start > 1.0).any():
        search.begin_with(np.searchsorted(prior.inflations, start))
    log_prior = prior.log_probabilities
    numbers = np.arange(len(points))
    for _ in range(sweeps * max(len(points), 1)):
        logs = search.log_ratios() + log_prior
        logs -= logs[numbers, search.kinds][:, None]
        best = np.argmax(logs, axis=1)
        if not (best != search.kinds).any():
            break
        worst = int(np.argmax(logs[numbers, best]))
        search.change(worst, int(best[worst]))
    sums = np.logaddexp.reduce(logs, axis=1)
    log_density = search.log_density() + float(log_prior[search.kinds].sum() + sums.sum())
    odds = np.logaddexp.reduce(logs[:, 1:], axis=1) - logs[:, 0]
    return GrossErrors(log_density, odds, prior.inflations[search.kinds])


def columns_of_inflation(model: GaussianModel, points: Sequence[Ints], inflation: Floats) -> Floats:
    """Columns (n, k) of normal coefficients by which the noise of points is as many times larger (g,) as it is."""
    blocks = [np.zeros((len(model), 0))]
    for number in np.flatnonzero(inflation > 1.0).tolist():
        columns = np.zeros((len(model), len(points[number])))
        noise = model.noise_blocks(points[number][None])[0]
        columns[points[number]] = np.linalg.cholesky((inflation[number] ** 2 - 1.0) * noise)
        blocks.append(columns)
    return np.concatenate(blocks, axis=1)


@dataclass(frozen=True, eq=False)
class _Group:
    """Points with equally many rows: numbers (g,), rows (g, d), noise (g, d, d), and `P_ii` if all are sound."""

    numbers: Ints
    rows: Ints
    noise: Floats
    precision: Floats


class _Search:
    """The inflation of each point, and the inverse of the covariance with them, as updates of that with none.

    With the rows R of all gross errors, `P = P_0 - P_0[:, R] (Delta_R^-1 + P_0[R, R])^-1 P_0[R, :]` (Woodbury).
    """

    def __init__(self, model: GaussianModel, residual: Floats, points: Sequence[Ints], prior: Outliers) -> None:
        self.kinds = np.zeros(len(points), dtype=np.int64)
        self._model, self._points = model, points
        # variance with each inflation, in units of that of a sound point
        self._variances = prior.inflations**2
        sizes = np.array([len(rows) for rows in points], dtype=np.int64)
        self._groups = []
        for size in np.unique(sizes).tolist():
            numbers = np.flatnonzero(sizes == size)
            rows = np.array([points[number] for number in numbers.tolist()])
            self._groups.append(_Group(numbers, rows, model.noise_blocks(rows), model.precision_blocks(rows)))
        self._weighted = model.precision_times(residual)
        self._log_sound = float(model.log_density(residual))
        # of points that have been inflated: columns of `P_0`, the inverse of their noise and its log determinant
        self._changed: dict[int, tuple[Floats, Floats, float]] = {}
        self._update()

    def change(self, number: int, kind: int) -> None:
        """Give a point another inflation."""
        self.kinds[number] = kind
        self._prepare(number)
        self._update()

    def begin_with(self, kinds: Ints) -> None:
        """Give all points their inflations at once."""
        self.kinds = kinds.copy()
        for number in np.flatnonzero(kinds).tolist():
            self._prepare(number)
        self._update()

    def _prepare(self, number: int) -> None:
        if number not in self._changed:
            rows = self._points[number]
            noise = self._model.noise_blocks(rows[None])[0]
            columns = self._model.precision_columns(rows)
            self._changed[number] = columns, np.asarray(np.linalg.inv(noise)), float(np.linalg.slogdet(noise)[1])

    def _update(self) -> None:
        """Factor of `Delta_R^-1 + P_0[R, R]`, and its inverse times `P_0[R, :]` and `(P_0 r)_R`."""
        from scipy.linalg import solve_triangular

        numbers = np.flatnonzero(self.kinds).tolist()
        R = np.concatenate([np.zeros(0, dtype=np.int64), *(self._points[number] for number in numbers)])
        columns = np.concatenate([np.zeros((len(self._model), 0)), *(self._changed[k][0] for k in numbers)], axis=1)
        inner, at, log_determinant = columns[R], 0, 0.0
        for number in numbers:
            _, inverse, log_noise = self._changed[number]
            size, increase = len(inverse), float(self._variances[self.kinds[number]]) - 1.0
            inner[at : at + size, at : at + size] += inverse / increase
            log_determinant += log_noise + size * np.log(increase)
            at += size
        factor = np.linalg.cholesky(inner)
        right_sides = np.column_stack([columns.T, self._weighted[R]])
        solved = solve_triangular(factor, right_sides, lower=True, check_finite=False) if numbers else right_sides
        self._projected, self._residual = solved[:, :-1].T, solved[:, -1]
        self._log_determinant = log_determinant + 2.0 * float(np.log(np.diag(factor)).sum())

    def log_ratios(self) -> Floats:
        """Log density (g, k) with every inflation of each point, less that with its current one."""
        weighted = self._weighted - self._projected @ self._residual
        logs = np.empty((len(self.kinds), len(self._variances)))
        for group in self._groups:
            projected = self._projected[group.rows]
            P = group.precision - projected @ np.swapaxes(projected, 1, 2)
            current = self._variances[self.kinds[group.numbers]]
            for kind, variance in enumerate(self._variances.tolist()):
                change = (variance - current)[:, None, None] * group.noise
                logs[group.numbers, kind] = _log_ratios(weighted[group.rows], P, change)
        return logs

    def log_density(self) -> float:
        """Of the rows, with the current inflations."""
        return self._log_sound + 0.5 * float(self._residual @ self._residual) - 0.5 * self._log_determinant


def _log_ratios(v: Floats, P: Floats, change: Floats) -> Floats:
    """Log densities (g,) with a change of each point's covariance, less those without it."""
    inner = np.eye(v.shape[1]) + change @ P
    squares = np.einsum("gi,gi->g", v, np.linalg.solve(inner, change @ v[:, :, None])[:, :, 0])
    return np.asarray(0.5 * squares - 0.5 * np.linalg.slogdet(inner)[1])
