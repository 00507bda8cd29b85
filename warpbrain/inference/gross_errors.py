"""Points whose noise is far larger than declared, such as mispaired landmarks: each hypothesis pays for its own.

The noise of point i is `w_i` times as large, 1 or one of few inflations: the covariance of its rows is larger by
`Delta_i = (w_i^2 - 1) kappa^2 (L L^T)_ii`. Given all other rows and the
inflations of the other points, another inflation, which changes it by `D_i`, has

    ln p(r | w_i') / p(r | w_i) = v^T (I + D_i P_ii)^-1 D_i v / 2 - ln |I + D_i P_ii| / 2

with `v = (S^-1 r)_i` and `P_ii = (S^-1)_ii`. Points that are gross errors under one hypothesis may be explained
by another, so no point is discarded before hypotheses are compared.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
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


@dataclass(frozen=True, eq=False)
class Sound:
    """Rows if all points are sound: `S^-1 r` (n,) and `ln N(r; 0, S)`."""

    weighted: Floats
    log_density: float

    @classmethod
    def at_scales(cls, model: GaussianModel, scales: Floats, residual: Floats) -> Iterator[Sound]:
        """With each of some factors on the noise: what they have in common is computed once."""
        logs = model.log_density_at(scales.tolist(), residual).tolist()
        return map(cls, model.precision_times_at(scales.tolist(), residual), logs)


def with_gross_errors(
    model: GaussianModel,
    residual: Floats,
    points: Sequence[Ints],
    prior: Outliers,
    sweeps: int = 10,
    start: Floats | None = None,
    sound: Sound | None = None,
    further: Floats | None = None,
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
    sound : Sound, optional
        Of these rows under the model, if that is known.
    further : (n, k) array, optional
        Columns beside those of the model: few, with which nothing is factorised again.
    """
    if sound is None:
        sound = next(Sound.at_scales(model, np.array([model.scale]), residual))
    search = _Search(model, sound, points, prior, np.zeros((len(model), 0)) if further is None else further)
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

    With the rows R of all gross errors, `P = P_0 - P_0[:, R] (Delta_R^-1 + P_0[R, R])^-1 P_0[R, :]` (Woodbury) is
    `P_0 - Z Z^T`, to which points are added as by Cholesky's method. Further columns G of the model are in `Z`, too:
    `P_0 G (I + G^T P_0 G)^-1 G^T P_0`.
    """

    def __init__(
        self, model: GaussianModel, sound: Sound, points: Sequence[Ints], prior: Outliers, further: Floats
    ) -> None:
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
        self._sound, self._further = sound, further
        self._by_further = model.precision_times(further) if further.shape[1] else further
        self._begin()

    def change(self, number: int, kind: int) -> None:
        """Give a point another inflation."""
        before = int(self.kinds[number])
        self.kinds[number] = kind
        if before == 0:
            self._inflate([number])
        else:
            self.begin_with(self.kinds)

    def begin_with(self, kinds: Ints) -> None:
        """Give all points their inflations at once."""
        self.kinds = kinds.copy()
        self._begin()
        self._inflate(np.flatnonzero(kinds).tolist())

    def _begin(self) -> None:
        """With all points sound."""
        G, u = self._further, self._by_further
        self._Z, self._weighted = np.zeros((len(G), 0)), self._sound.weighted.copy()
        self._precisions = [group.precision.copy() for group in self._groups]
        self._log_change = 0.0
        if G.shape[1]:
            self._add(u, np.eye(G.shape[1]) + G.T @ u, G.T @ self._weighted, 0.0)

    def _inflate(self, numbers: Sequence[int]) -> None:
        """Add the rows of some points to `Z`, and what follows to the inverse and the log density."""
        if not numbers:
            return
        R = np.concatenate([self._points[number] for number in numbers])
        P_0 = self._model.precision_columns(R)
        columns = P_0 - self._Z @ self._Z[R].T
        inner, at, log_determinant = columns[R], 0, 0.0
        for number in numbers:
            rows = self._points[number]
            part = slice(at, at := at + len(rows))
            increase = (self._variances[self.kinds[number]] - 1.0) * self._model.noise_blocks(rows[None])[0]
            inner[part, part] += np.linalg.inv(increase)
            log_determinant += float(np.linalg.slogdet(increase)[1])
        self._add(columns, inner, self._weighted[R], log_determinant)

    def _add(self, columns: Floats, inner: Floats, weighted: Floats, log_determinant: float) -> None:
        """Take `columns inner^-1 columns^T` off the inverse, of which `weighted` is the projection of the rows."""
        factor = np.linalg.cholesky(inner)
        inverse = np.linalg.inv(factor)
        added, residual = columns @ inverse.T, inverse @ weighted
        self._Z = np.concatenate([self._Z, added], axis=1)
        self._weighted -= added @ residual
        for group, precision in zip(self._groups, self._precisions, strict=True):
            of_points = added[group.rows]
            precision -= np.einsum("gik,gjk->gij", of_points, of_points)
        log_determinant += 2.0 * float(np.log(np.diag(factor)).sum())
        self._log_change += 0.5 * float(residual @ residual) - 0.5 * log_determinant

    def log_ratios(self) -> Floats:
        """Log density (g, k) with every inflation of each point, less that with its current one."""
        logs = np.empty((len(self.kinds), len(self._variances)))
        for group, precision in zip(self._groups, self._precisions, strict=True):
            changes = self._variances - self._variances[self.kinds[group.numbers]][:, None]
            logs[group.numbers] = _log_ratios(self._weighted[group.rows], precision, group.noise, changes)
        return logs

    def log_density(self) -> float:
        """Of the rows, with the current inflations."""
        return self._sound.log_density + self._log_change


def _log_ratios(v: Floats, P: Floats, noise: Floats, changes: Floats) -> Floats:
    """Log densities (g, k) with `changes` (g, k) of each point's variance in units of its noise, less those without."""
    inner = np.eye(v.shape[1]) + changes[:, :, None, None] * (noise @ P)[:, None]
    right = changes[:, :, None] * np.einsum("gij,gj->gi", noise, v)[:, None]
    solved, determinant = _solved(inner, right)
    return np.asarray(0.5 * (np.einsum("gi,gki->gk", v, solved) - np.log(determinant)))


def _solved(A: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Solutions (..., d) and determinants (...) of many small systems (..., d, d); of three rows by Cramer's rule."""
    if A.shape[-1] == 1:
        return b / A[..., 0], A[..., 0, 0]
    if A.shape[-1] != 3:
        solution = np.asarray(np.linalg.solve(A, b[..., None])[..., 0], dtype=np.float64)
        return solution, np.asarray(np.linalg.det(A), dtype=np.float64)
    first, second, third = ([A[..., i, j] for j in range(3)] for i in range(3))
    of_first, of_second, of_third = _cross(second, third), _cross(third, first), _cross(first, second)
    determinant = first[0] * of_first[0] + first[1] * of_first[1] + first[2] * of_first[2]
    solution = np.empty(b.shape)
    for j in range(3):
        numerator = b[..., 0] * of_first[j] + b[..., 1] * of_second[j] + b[..., 2] * of_third[j]
        solution[..., j] = numerator / determinant
    return solution, determinant


def _cross(a: Sequence[Floats], b: Sequence[Floats]) -> tuple[Floats, Floats, Floats]:
    """Vector product of components; NumPy's own takes several times as long for small arrays."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
