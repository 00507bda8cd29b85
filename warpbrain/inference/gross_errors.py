"""Points whose noise is far larger than declared, such as mispaired landmarks: each hypothesis pays for its own.

The noise of point i is `w_i` times as large, 1 or one of few inflations: the covariance of its rows is larger by
`Delta_i = (w_i^2 - 1) kappa^2 (L L^T)_ii`. Given all other rows and the
inflations of the other points, another inflation, which changes it by `D_i`, has

    ln p(r | w_i') / p(r | w_i) = v^T (I + D_i P_ii)^-1 D_i v / 2 - ln |I + D_i P_ii| / 2

with `v = (S^-1 r)_i` and `P_ii = (S^-1)_ii`. Points that are gross errors under one hypothesis may be explained
by another, so no point is discarded before hypotheses are compared.

Hypotheses that differ in some columns `G` alone, or in their length f, share all else: with
`G^T S_0^-1 G = V diag(l) V^T` and `D = S_0^-1 G V`

    S^-1 = S_0^-1 - D diag(f^2 / (1 + f^2 l)) D^T

The marginal likelihood of a hypothesis is that density, summed over the scale of the noise, too.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.inference.gaussian import GaussianModel
from warpbrain.inference.noise import Outliers, outliers, scales

#: Passes over the points at most.
_SWEEPS = 10
#: The sum over scales ends where a term is below this part of the largest.
_NEGLIGIBLE = 1e-3


@dataclass(frozen=True, eq=False)
class GrossErrors:
    """Gross errors under one hypothesis."""

    #: Log density of the rows, summed over the inflation of each point with all others at their most probable ones.
    log_density: float
    log_odds: Floats  # (g,), of each point to be a gross error, given the others
    inflation: Floats  # (g,), the most probable one of each point, 1 of a sound one
    weighted: Floats  # (n,), the inverse of the covariance with these, times the rows


@dataclass(frozen=True, eq=False)
class _Group:
    """Points with equally many rows: numbers (g,), rows (g, d), noise (g, d, d), and `P_ii` if all are sound."""

    numbers: Ints
    rows: Ints
    noise: Floats
    precision: Floats


class PointRows:
    """Rows of recorded points under a model: what hypotheses with further columns have in common.

    `residual` (n,): less what is expected of the causes.
    `points`: rows of each point; rows of none are never gross errors.
    `weighted` (n,): `S^-1 r`, if it is known.
    """

    def __init__(
        self, model: GaussianModel, residual: Floats, points: Sequence[Ints], weighted: Floats | None = None
    ) -> None:
        self.model, self.points, self.residual = model, points, residual
        self.weighted = model.precision_times(residual) if weighted is None else weighted
        self.log_density = model.log_density_of(residual, self.weighted)
        sizes = np.array([len(rows) for rows in points], dtype=np.int64)
        self.groups = []
        for size in np.unique(sizes).tolist():
            numbers = np.flatnonzero(sizes == size)
            rows = np.array([points[number] for number in numbers.tolist()])
            self.groups.append(_Group(numbers, rows, model.noise_blocks(rows), model.precision_blocks(rows)))
        #: Of each point the inverse (d, d) of its noise, and the logarithm of its determinant.
        self.noise: dict[int, tuple[Floats, float]] = {}
        for group in self.groups:
            logs = np.linalg.slogdet(group.noise)[1].tolist()
            self.noise |= zip(group.numbers.tolist(), zip(np.linalg.inv(group.noise), logs, strict=True), strict=True)

    def less(self, mean: Floats) -> PointRows:
        """The same less a change (n,) of the rows."""
        if not mean.any():
            return self
        other = copy.copy(self)
        other.residual = self.residual - mean
        other.weighted = self.model.precision_times(other.residual)
        other.log_density = self.model.log_density_of(other.residual, other.weighted)
        return other

    def with_gross_errors(
        self,
        prior: Outliers,
        start: Floats | None = None,
        further: FurtherColumns | None = None,
        length: float = 1.0,
    ) -> GrossErrors:
        """Density of the rows where some points may be gross errors.

        `start` (g,): the most probable inflation of each point under a hypothesis that is nearly the same; all are
        sound by default.
        `further`: of these rows.
        `length`: a factor on these.
        """
        search = _Search(self, prior, further, length)
        if start is not None and (start > 1.0).any():
            search.begin_with(np.searchsorted(prior.inflations, start))
        log_prior = prior.log_probabilities
        numbers = np.arange(len(self.points))
        # the point whose odds change sides the most goes first
        for _ in range(_SWEEPS * max(len(numbers), 1)):
            logs = search.log_ratios() + log_prior
            logs -= logs[numbers, search.kinds][:, None]
            best = np.argmax(logs, axis=1)
            if not (best != search.kinds).any():
                break
            worst = int(np.argmax(logs[numbers, best]))
            search.change(worst, int(best[worst]))
        sums = np.logaddexp.reduce(logs, axis=1)
        log_density = search.log_density + float(log_prior[search.kinds].sum() + sums.sum())
        odds = np.logaddexp.reduce(logs[:, 1:], axis=1) - logs[:, 0]
        return GrossErrors(log_density, odds, prior.inflations[search.kinds], search.weighted)


class FurtherColumns:
    """Columns (n, k) beside those of a model of rows.

    `columns` (n, k). `weighted` (n, k): `S_0^-1 G`, if it is known.
    """

    def __init__(self, rows: PointRows, columns: Floats, weighted: Floats | None = None) -> None:
        weighted = rows.model.precision_times(columns) if weighted is None else weighted
        values, vectors = np.linalg.eigh(columns.T @ weighted)
        #: `l` (k,) and `D^T` (k, n).
        self.values, self.dual = np.maximum(values, 0.0), vectors.T @ weighted.T
        #: Of each group of points with the rows (g, d), products of each two rows of `D`: (k, g d^2).
        self.products = []
        for group in rows.groups:
            of_points = self.dual[:, group.rows]
            pairs = of_points[..., :, None] * of_points[..., None, :]
            self.products.append(pairs.reshape(len(self.dual), group.rows.size * group.rows.shape[1]))


def with_gross_errors(model: GaussianModel, residual: Floats, points: Sequence[Ints], prior: Outliers) -> GrossErrors:
    """Density of rows where some points may be gross errors: `PointRows`, with the causes among the columns."""
    return PointRows(model, residual, points).with_gross_errors(prior)


def columns_of_inflation(model: GaussianModel, points: Sequence[Ints], inflation: Floats) -> Floats:
    """Columns (n, k) of normal coefficients by which the noise of points is as many times larger (g,) as it is."""
    blocks = [np.zeros((len(model), 0))]
    for number in np.flatnonzero(inflation > 1.0).tolist():
        columns = np.zeros((len(model), len(points[number])))
        noise = model.noise_blocks(points[number][None])[0]
        columns[points[number]] = np.linalg.cholesky((inflation[number] ** 2 - 1.0) * noise)
        blocks.append(columns)
    return np.concatenate(blocks, axis=1)


class _Search:
    """The inflation of each point, and the inverse of the covariance with them, as updates of that with none.

    With the rows R of all gross errors, `P = P_0 - P_0[:, R] (Delta_R^-1 + P_0[R, R])^-1 P_0[R, :]` (Woodbury) is
    `P_0 - Z^T Z`, to which points are added as by Cholesky's method. `P_0` is the inverse of the covariance of the
    noise less `Y^T Y`, to which further columns belong, too.
    """

    def __init__(self, rows: PointRows, prior: Outliers, further: FurtherColumns | None, length: float) -> None:
        self.kinds = np.zeros(len(rows.points), dtype=np.int64)
        self._rows = rows
        # variance with each inflation, in units of that of a sound point
        self._variances = prior.inflations**2
        self._Y = rows.model.low_rank
        self.weighted, self.log_density = rows.weighted, rows.log_density
        self._precisions = [group.precision for group in rows.groups]
        if further is not None:
            self._add_columns(further, length)
        self._sound = self.weighted, self.log_density, self._precisions
        self.begin_with(self.kinds)

    def _add_columns(self, further: FurtherColumns, length: float) -> None:
        lengthened = 1.0 + length**2 * further.values
        weights, projected = length**2 / lengthened, further.dual @ self._rows.residual
        self._Y = np.concatenate([self._Y, further.dual * np.sqrt(weights)[:, None]])
        self.weighted = self.weighted - (weights * projected) @ further.dual
        self.log_density += 0.5 * float(weights @ projected**2) - 0.5 * float(np.log(lengthened).sum())
        pairs = zip(self._precisions, further.products, strict=True)
        self._precisions = [P - (weights @ products).reshape(P.shape) for P, products in pairs]

    def change(self, number: int, kind: int) -> None:
        """Give a point another inflation."""
        before, self.kinds[number] = int(self.kinds[number]), kind
        if kind > before:
            self._inflate([number], before)
        else:
            self.begin_with(self.kinds)

    def begin_with(self, kinds: Ints) -> None:
        """Give all points their inflations at once."""
        self.kinds = kinds.copy()
        weighted, self.log_density, precisions = self._sound
        self.weighted, self._precisions = weighted.copy(), [precision.copy() for precision in precisions]
        self._Z = np.zeros((0, len(weighted)))
        self._inflate(np.flatnonzero(kinds).tolist())

    def _inflate(self, numbers: Sequence[int], before: int = 0) -> None:
        """Add the rows of points, of a lesser inflation before, to `Z`, and what follows to inverse and log density."""
        if not numbers:
            return
        points, noise = self._rows.points, self._rows.noise
        R = np.concatenate([points[number] for number in numbers])
        columns = self._rows.model.noise_precision(R)
        for low_rank in (self._Y, self._Z):
            columns -= low_rank[:, R].T @ low_rank
        inner, at, log_determinant = columns[:, R], 0, 0.0
        for number in numbers:
            part = slice(at, at := at + len(points[number]))
            increase = float(self._variances[self.kinds[number]] - self._variances[before])
            inverse, log_of_noise = noise[number]
            inner[part, part] += inverse / increase
            log_determinant += log_of_noise + len(inverse) * math.log(increase)
        factor = np.linalg.cholesky(inner)
        whiten = np.linalg.inv(factor)
        added, residual = whiten @ columns, whiten @ self.weighted[R]
        self._Z = np.concatenate([self._Z, added])
        self.weighted -= residual @ added
        for group, precision in zip(self._rows.groups, self._precisions, strict=True):
            of_points = added[:, group.rows]
            precision -= np.einsum("kgi,kgj->gij", of_points, of_points)
        log_determinant += 2.0 * float(np.log(np.diag(factor)).sum())
        self.log_density += 0.5 * float(residual @ residual) - 0.5 * log_determinant

    def log_ratios(self) -> Floats:
        """Log density (g, k) with every inflation of each point, less that with its current one."""
        logs = np.empty((len(self.kinds), len(self._variances)))
        for group, precision in zip(self._rows.groups, self._precisions, strict=True):
            # of each point's variance (g, k) in units of its noise
            changes = self._variances - self._variances[self.kinds[group.numbers]][:, None]
            v, noise = self.weighted[group.rows], group.noise
            inner = np.eye(v.shape[1]) + changes[:, :, None, None] * (noise @ precision)[:, None]
            right = changes[:, :, None] * np.einsum("gij,gj->gi", noise, v)[:, None]
            solved, determinant = _solved(inner, right)
            logs[group.numbers] = 0.5 * (np.einsum("gi,gki->gk", v, solved) - np.log(determinant))
        return logs


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


@dataclass(frozen=True, eq=False)
class Summed:
    """Evidence summed over scales of the noise and over gross errors."""

    log_evidence: float  # [nats]
    scale: float  # the most probable factor on the noise
    inflation: Floats  # (g,), most probable factor on the noise of each point at that scale, 1 of sound ones


@dataclass(frozen=True, eq=False)
class Marginal(Summed):
    """The same with the most probable model of the rows under one hypothesis."""

    model: GaussianModel  # at that scale; the excess noise of these points is columns after those of the hypothesis
    count: int  # how many columns the hypothesis has

    @property
    def gross(self) -> Bools:
        """Points (g,) that are most probably gross errors."""
        return self.inflation > 1.0

    @cached_property
    def noise(self) -> GaussianModel:
        """Of the noise alone, with the excess noise of gross errors."""
        covariance = self.model.noise_covariance + self.excess @ self.excess.T
        factor: Floats = np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)
        return GaussianModel(factor, np.zeros((len(factor), 0)))

    def coordinates(self, residual: Floats) -> Floats:
        """Mean of the coefficients (q,) of the hypothesis after residuals (n,)."""
        return self.model.coefficients(residual)[0][: self.count]

    @property
    def excess(self) -> Floats:
        """Columns (n, e) of the excess noise of gross errors."""
        return self.model.columns[:, self.count :]


class RowsAtScales:
    """Evidence of rows under a model with further columns, whose length and the scale of the noise may vary.

    What neither changes is computed once.

    `model`: the causes of the hypothesis among its columns.
    `residual` (n,): less what is expected of the causes.
    `points`: rows of each point.
    `further` (n, k).
    """

    def __init__(
        self, model: GaussianModel, residual: Floats, points: Sequence[Ints], further: Floats | None = None
    ) -> None:
        self._model, self._residual, self._points = model, residual, points
        self._further = np.zeros((len(residual), 0)) if further is None else further
        self._values, self._log_prior = scales()
        self._weighted = [model.precision_at(rows) for rows in (residual, self._further)]
        self._at: dict[float, tuple[PointRows, FurtherColumns]] = {}

    def summed(self, length: float = 1.0, scale: float = 1.0, inflation: Floats | None = None) -> Summed:
        """The evidence with the further columns multiplied by a factor.

        `length`: that factor.
        `scale`: a factor on the noise near the most probable one, where the sum begins.
        `inflation` (g,): of gross errors under a hypothesis that is nearly the same.
        """
        values = self._values
        first = int(np.argmin(np.abs(np.log(values / scale))))
        inflations: dict[int, Floats] = {}

        def log_density(number: int) -> float:
            at_scale = self.with_gross_errors(float(values[number]), length, inflations.get(first, inflation))
            inflations[number] = at_scale.inflation
            return at_scale.log_density + float(self._log_prior[number])

        logs = outward(log_density, first, len(values), _NEGLIGIBLE)
        best = int(np.argmax(logs))
        return Summed(float(np.logaddexp.reduce(logs)), float(values[best]), inflations[best])

    def with_gross_errors(self, scale: float, length: float = 1.0, start: Floats | None = None) -> GrossErrors:
        """Density at one scale of the noise, with the further columns multiplied by `length`."""
        if scale not in self._at:
            weighted, of_further = (times(scale) for times in self._weighted)
            rows = PointRows(self._model.with_scale(scale), self._residual, self._points, weighted)
            self._at[scale] = rows, FurtherColumns(rows, self._further, of_further)
        rows, further = self._at[scale]
        return rows.with_gross_errors(outliers(), start, further, length)


def outward(log_evidence: Callable[[int], float], first: int, count: int, negligible: float) -> Floats:
    """Log evidence (count,) by number, as far from the first one as it is not below a part of the largest."""
    logs = np.full(count, -np.inf)
    logs[first] = log_evidence(first)
    for step in (-1, 1):
        number = first + step
        while 0 <= number < count:
            logs[number] = log_evidence(number)
            if logs[number] < logs.max() + np.log(negligible):
                break
            number += step
    return logs


def marginal_of(model: GaussianModel, points: Sequence[Ints], summed: Summed) -> Marginal:
    """Evidence and most probable model of a sum; `model` has the columns of the hypothesis, at a scale of one."""
    at_best = model.of_noise(model.columns, summed.scale)
    excess = columns_of_inflation(at_best, points, summed.inflation)
    with_excess = model.of_noise(np.column_stack([model.columns, excess]), summed.scale)
    return Marginal(summed.log_evidence, summed.scale, summed.inflation, with_excess, model.columns.shape[1])
