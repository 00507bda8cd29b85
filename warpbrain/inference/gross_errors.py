"""Points whose noise is far larger than declared, such as mispaired landmarks: each hypothesis pays for its own.

The noise of point i is `w_i` times as large, 1 or one of few inflations: the covariance of its rows is larger by
`Delta_i = (w_i^2 - 1) kappa^2 (L L^T)_ii`. Given all other rows and the
inflations of the other points, another inflation, which changes it by `D_i`, has

    ln p(r | w_i') / p(r | w_i) = v^T (I + D_i P_ii)^-1 D_i v / 2 - ln |I + D_i P_ii| / 2

with `v = (S^-1 r)_i` and `P_ii = (S^-1)_ii`. Points that are gross errors under one hypothesis may be explained
by another, so no point is discarded before hypotheses are compared.

Hypotheses that differ in some columns `G` alone, or in their length f, share all else:

    S^-1 = S_0^-1 - f^2 S_0^-1 G (I + f^2 G^T S_0^-1 G)^-1 G^T S_0^-1
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpbrain.arrays import Floats, Ints
from warpbrain.inference.gaussian import GaussianModel
from warpbrain.inference.noise import Outliers, outliers
from warpbrain.threads import in_threads

#: Passes over the points at most.
_SWEEPS = 10
#: Rows for which there is room when some are added.
_ROOM = 30


@dataclass(frozen=True, eq=False)
class GrossErrors:
    """Gross errors under one hypothesis."""

    #: Log density of the rows, summed over the inflation of each point with all others at their most probable ones.
    log_density: float
    inflation: Floats  # (g,), the most probable one of each point, 1 of a sound one
    weighted: Floats  # (n,), the inverse of the covariance with these, times the rows


@dataclass(frozen=True, eq=False)
class _Group:
    """Points with equally many rows: numbers (g,), rows (d, g), and noise (d, d, g)."""

    numbers: Ints
    rows: Ints
    noise: Floats


class PointNoise:
    """Noise of recorded points by themselves: the same for all hypotheses, and at all scales but for a factor.

    `model`: of that noise. `points`: rows of each point; rows of none are never gross errors.
    """

    def __init__(self, model: GaussianModel, points: Sequence[Ints]) -> None:
        self.points = points
        sizes = np.array([len(rows) for rows in points], dtype=np.int64)
        self.groups = []
        #: Of each point the inverse (d, d) of its noise, and the logarithm of its determinant.
        self.inverse: dict[int, tuple[Floats, float]] = {}
        for size in np.unique(sizes).tolist():
            numbers = np.flatnonzero(sizes == size)
            rows = np.array([points[number] for number in numbers.tolist()])
            noise = model.noise_blocks(rows) / model.scale**2
            self.groups.append(_Group(numbers, np.ascontiguousarray(rows.T), _points_last(noise)))
            logs = np.linalg.slogdet(noise)[1].tolist()
            self.inverse |= zip(numbers.tolist(), zip(np.linalg.inv(noise), logs, strict=True), strict=True)

    @classmethod
    def of(cls, model: GaussianModel, points: Sequence[Ints]) -> PointNoise:
        """The same, made once for all models with that noise."""
        return model.once(points, lambda: cls(model, points))


class PointRows:
    """Rows of recorded points under a model: what hypotheses with further columns have in common.

    `residual` (n,): less what is expected of the causes.
    `noise`: of its points.
    `weighted` (n,): `S^-1 r`, if it is known.
    """

    def __init__(
        self, model: GaussianModel, residual: Floats, noise: PointNoise, weighted: Floats | None = None
    ) -> None:
        self.model, self.noise, self.residual = model, noise, residual
        self.weighted = model.precision_times(residual) if weighted is None else weighted
        self.log_density = model.log_density_of(residual, self.weighted)
        #: Of each group of points `P_ii` (d, d, g) if all are sound.
        self.precisions = [_points_last(model.precision_blocks(group.rows.T)) for group in noise.groups]

    def less(self, mean: Floats, weighted: Floats) -> PointRows:
        """The same less a change (n,) of the rows, of which `S^-1` times it (n,) is known."""
        if not mean.any():
            return self
        other = copy.copy(self)
        other.residual, other.weighted = self.residual - mean, self.weighted - weighted
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
        numbers = np.arange(len(self.noise.points))
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
        return GrossErrors(log_density, prior.inflations[search.kinds], search.weighted)


class FurtherColumns:
    """Columns `G` (n, k) beside those of a model of rows; `weighted` (n, k): `S_0^-1 G`."""

    def __init__(self, columns: Floats, weighted: Floats) -> None:
        self._weighted, self._products = weighted, columns.T @ weighted

    def factor(self, length: float) -> tuple[Floats, float]:
        """`F` (k, n), with `S^-1 = S_0^-1 - F^T F` for columns `f G` of length `f`, and `ln |S| - ln |S_0|`."""
        from scipy.linalg import solve_triangular

        lower = np.linalg.cholesky(np.eye(len(self._products)) + length**2 * self._products)
        factor = solve_triangular(lower, length * self._weighted.T, lower=True, check_finite=False)
        return np.asarray(factor), 2.0 * float(np.log(lower.diagonal()).sum())


def with_gross_errors(model: GaussianModel, residual: Floats, points: Sequence[Ints], prior: Outliers) -> GrossErrors:
    """Density of rows where some points may be gross errors: `PointRows`, with the causes among the columns."""
    return PointRows(model, residual, PointNoise.of(model, points)).with_gross_errors(prior)


def log_densities_of(
    model: GaussianModel, residual: Floats, points: Sequence[Ints], tried: Sequence[tuple[Floats, Floats]]
) -> Floats:
    """Log density (k,) of rows under each of several causes, with gross errors of its own.

    `model`: of the rows without any of them. `residual` (n,). `points`: rows of each point. `tried`: mean (n,) and
    columns (n, j) of each.
    """
    rows, prior = PointRows(model, residual, PointNoise.of(model, points)), outliers()
    # one pass over the inverse for all
    weighted = model.precision_times(np.column_stack([np.column_stack(each) for each in tried]))
    first = np.cumsum([0, *(1 + columns.shape[1] for _, columns in tried)]).tolist()

    def log_density(number: int) -> float:
        (mean, columns), at = tried[number], first[number]
        less = rows.less(mean, weighted[:, at])
        further = FurtherColumns(columns, weighted[:, at + 1 : first[number + 1]])
        return less.with_gross_errors(prior, further=further).log_density

    return np.array(in_threads(log_density, range(len(tried))))


def columns_of_inflation(model: GaussianModel, points: Sequence[Ints], inflation: Floats) -> Floats:
    """Columns (n, k) of normal coefficients by which the noise of points is as many times larger (g,) as it is."""
    blocks = [np.zeros((len(model), 0))]
    for number in np.flatnonzero(inflation > 1.0).tolist():
        columns = np.zeros((len(model), len(points[number])))
        noise = model.noise_blocks(points[number][None])[0]
        columns[points[number]] = np.linalg.cholesky((inflation[number] ** 2 - 1.0) * noise)
        blocks.append(columns)
    return np.concatenate(blocks, axis=1)


def noise_with_excess(model: GaussianModel, excess: Floats) -> GaussianModel:
    """The noise of a model, without its columns, to which the covariance `E E^T` of columns `E` (n, e) is added."""
    factor: Floats = np.asarray(np.linalg.cholesky(model.noise_covariance + excess @ excess.T), dtype=np.float64)
    return GaussianModel(factor, np.zeros((len(factor), 0)))


class _Search:
    """The inflation of each point, and the inverse of the covariance with them, as updates of that with none.

    With the rows R of all gross errors, `P = P_0 - P_0[:, R] (Delta_R^-1 + P_0[R, R])^-1 P_0[R, :]` (Woodbury) is
    `P_0 - Z^T Z`, to which points are added as by Cholesky's method; of a point whose inflation becomes smaller the
    square is added. `P_0` is the inverse of the covariance of the noise less `Y^T Y`, to which further columns belong,
    too.
    """

    def __init__(self, rows: PointRows, prior: Outliers, further: FurtherColumns | None, length: float) -> None:
        self.kinds = np.zeros(len(rows.noise.points), dtype=np.int64)
        self._rows = rows
        # variance with each inflation, in units of that of a sound point
        self._variances = prior.inflations**2
        # rows of `Y`, and of `Z` after these: one product with all of them, and room for more
        self._low_rank, self._count = rows.model.low_rank, len(rows.model.low_rank)
        # -1 for rows whose squares are added
        self._signs = np.ones(self._count)
        self.weighted, self.log_density = rows.weighted, rows.log_density
        self._precisions = rows.precisions
        if further is not None:
            added, log_determinant = further.factor(length)
            self._add(added, added @ rows.residual, log_determinant)

    def _add(self, added: Floats, projected: Floats, log_determinant: float, sign: float = 1.0) -> None:
        """Update `S^-1 r`, the log density and each `P_ii` for the inverse `P - F^T F`, or `P + F^T F` by its sign.

        `added` (k, n): `F`.
        `projected` (k,): the product of `F` with the rows as far as they are not explained yet.
        `log_determinant`: change of that of the covariance.
        `sign`: 1 where the covariance becomes larger, -1 where it becomes smaller.
        """
        self._append(added, sign)
        self.weighted = self.weighted - sign * projected @ added
        self.log_density += 0.5 * sign * float(projected @ projected) - 0.5 * log_determinant
        less = []
        for group, precision in zip(self._rows.noise.groups, self._precisions, strict=True):
            of_points = added[:, group.rows]
            less.append(precision - sign * np.einsum("kig,kjg->ijg", of_points, of_points))
        self._precisions = less

    def _append(self, added: Floats, sign: float = 1.0) -> None:
        """Add rows (k, n) to the low rank; what others may read is copied before it is written to."""
        end = self._count + len(added)
        if end > len(self._low_rank) or self._low_rank is self._rows.model.low_rank:
            larger = np.empty((end + _ROOM, added.shape[1]))
            larger[: self._count] = self._low_rank[: self._count]
            self._low_rank = larger
        self._low_rank[self._count : end] = added
        self._signs = np.concatenate([self._signs, np.full(len(added), sign)])
        self._count = end

    def change(self, number: int, kind: int) -> None:
        """Give a point another inflation."""
        before, self.kinds[number] = int(self.kinds[number]), kind
        self._inflate([number], before)

    def begin_with(self, kinds: Ints) -> None:
        """Give all points their inflations at once, where all were sound."""
        self.kinds = kinds.copy()
        self._inflate(np.flatnonzero(kinds).tolist())

    def _inflate(self, numbers: Sequence[int], before: int = 0) -> None:
        """Add the rows of points, which had one inflation before, to `Z`, and what follows to inverse and log density.

        All of their inflations become larger, or all smaller.
        """
        # NumPy's own take ten times as long for a point
        from scipy.linalg.lapack import dpotrf, dtrtri

        if not numbers:
            return
        noise, model = self._rows.noise, self._rows.model
        R = np.concatenate([noise.points[number] for number in numbers])
        low_rank = self._low_rank[: self._count]
        columns = model.noise_precision(R) - (low_rank[:, R] * self._signs[:, None]).T @ low_rank
        inner, at, log_determinant = columns[:, R], 0, 0.0
        sign = 1.0 if self.kinds[numbers[0]] > before else -1.0
        for number in numbers:
            part = slice(at, at := at + len(noise.points[number]))
            increase = float(self._variances[self.kinds[number]] - self._variances[before]) * model.scale**2
            inverse, log_of_noise = noise.inverse[number]
            inner[part, part] += inverse / increase
            log_determinant += log_of_noise + len(inverse) * math.log(sign * increase)
        factor, failed = dpotrf(sign * inner, lower=1)
        if failed:
            raise np.linalg.LinAlgError("the covariance without points is not positive definite")
        whiten = dtrtri(factor, lower=1)[0]
        log_determinant += 2.0 * float(np.log(factor.diagonal()).sum())
        self._add(whiten @ columns, whiten @ self.weighted[R], log_determinant, sign)

    def log_ratios(self) -> Floats:
        """Log density (g, k) with every inflation of each point, less that with its current one."""
        logs = np.empty((len(self.kinds), len(self._variances)))
        for group, precision in zip(self._rows.noise.groups, self._precisions, strict=True):
            # of each point's variance (g, k) in units of its noise
            changes = self._variances - self._variances[self.kinds[group.numbers]][:, None]
            changes *= self._rows.model.scale**2
            v, noise = self.weighted[group.rows], group.noise
            A, w = np.einsum("ikg,kjg->ijg", noise, precision), np.einsum("ijg,jg->ig", noise, v)
            inner = changes * A[..., None] + np.eye(len(A))[:, :, None, None]
            solved, determinant = _solved(inner, changes * w[..., None])
            logs[group.numbers] = 0.5 * (np.einsum("ig,igk->gk", v, solved) - np.log(determinant))
        return logs


def _points_last(blocks: Floats) -> Floats:
    """Blocks (g, d, d) as (d, d, g): of thousands of them each component is one array."""
    return np.ascontiguousarray(blocks.transpose(1, 2, 0))


def _solved(A: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Solutions (d, ...) and determinants (...) of many small systems (d, d, ...); of three rows by Cramer's rule."""
    if len(A) == 1:
        return b / A[0], A[0, 0]
    if len(A) != 3:
        systems, right = np.moveaxis(A, (0, 1), (-2, -1)), np.moveaxis(b, 0, -1)[..., None]
        solution = np.moveaxis(np.linalg.solve(systems, right)[..., 0], -1, 0)
        return np.asarray(solution), np.asarray(np.linalg.det(systems), dtype=np.float64)
    of_first, of_second, of_third = _cross(A[1], A[2]), _cross(A[2], A[0]), _cross(A[0], A[1])
    determinant = A[0, 0] * of_first[0] + A[0, 1] * of_first[1] + A[0, 2] * of_first[2]
    solution = np.empty(b.shape)
    for j in range(3):
        solution[j] = (b[0] * of_first[j] + b[1] * of_second[j] + b[2] * of_third[j]) / determinant
    return solution, determinant


def _cross(a: Floats, b: Floats) -> tuple[Floats, Floats, Floats]:
    """Vector product of components; NumPy's own takes several times as long for small arrays."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
