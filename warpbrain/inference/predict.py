"""Predictive checks: held-out rows given all others, and whether the residuals look like draws of the model.

With `P = S^-1` the rows of a block given all others have the mean `r_b - P_bb^-1 (P r)_b` and the covariance `P_bb^-1`:
exactly what conditioning the model on the others gives.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.inference.gaussian import GaussianModel

#: Standard errors between a p-value and a level it is compared with, and by how much draws may be multiplied for that.
_DEVIATIONS, _MOST_DRAWS = 3.0, 16
#: Draws of the bootstrap of an improvement.
_BOOTSTRAPS = 2000
#: Rows that are compared with all fields at a time.
_TOGETHER = 256


@dataclass(frozen=True, eq=False)
class Prediction:
    """Every block of rows predicted from all others."""

    errors: Floats  # (n,), what was recorded less what was predicted
    blocks: Ints  # (n,)
    log_densities: Floats  # (b,), of each block given the others

    def improvement(self, over: Prediction, rows: Bools, random: np.random.Generator) -> tuple[float, float, float]:
        """Part of another's root mean square error that is removed, and its 95 % interval by bootstrap over blocks."""
        names = np.unique(self.blocks[rows])
        squares = np.array([np.sum(self.errors[rows & (self.blocks == b)] ** 2) for b in names])
        squares_over = np.array([np.sum(over.errors[rows & (self.blocks == b)] ** 2) for b in names])
        chosen = random.integers(len(names), size=(_BOOTSTRAPS, len(names)))
        parts = 1.0 - np.sqrt(squares[chosen].sum(axis=1) / np.maximum(squares_over[chosen].sum(axis=1), 1e-300))
        low, high = np.quantile(parts, [0.025, 0.975])
        return float(1.0 - np.sqrt(squares.sum() / max(squares_over.sum(), 1e-300))), float(low), float(high)

    @property
    def log_density(self) -> float:
        """Of all blocks, each given the others."""
        return float(self.log_densities.sum())


def predict(model: GaussianModel, residual: Floats, blocks: Ints) -> Prediction:
    """Predict every block of rows. `residual` (n,), `blocks` (n,)."""
    return predict_with(model, residual, blocks, [np.zeros((len(model), 0))])[0]


def predict_with(
    model: GaussianModel, residual: Floats, blocks: Ints, column_sets: Sequence[Floats]
) -> tuple[Prediction, ...]:
    """Predict every block of rows with each of several sets of columns added to those of the model.

    With columns `G` the inverse covariance is `P - u (I + G^T u)^-1 u^T`, `u = P G` (Woodbury).

    `residual` (n,), `blocks` (n,), `column_sets` (n, k).
    """
    weighted = model.precision_times(residual)
    rows_of = [np.flatnonzero(blocks == block) for block in np.unique(blocks)]
    inverses = [model.precision_columns(rows)[rows] for rows in rows_of]
    predictions = []
    for columns in column_sets:
        u = model.precision_times(columns)
        inner: Floats = np.asarray(np.linalg.inv(np.eye(columns.shape[1]) + columns.T @ u), dtype=np.float64)
        projected = weighted - u @ (inner @ (columns.T @ weighted))
        errors, densities = np.zeros(len(residual)), []
        for rows, inverse in zip(rows_of, inverses, strict=True):
            L = np.linalg.cholesky(inverse - u[rows] @ inner @ u[rows].T)
            white = np.linalg.solve(L, projected[rows])
            errors[rows] = np.linalg.solve(L.T, white)
            volume = np.log(np.diag(L)).sum() - 0.5 * len(rows) * np.log(2.0 * np.pi)
            densities.append(volume - 0.5 * float(white @ white))
        predictions.append(Prediction(errors, blocks, np.array(densities)))
    return tuple(predictions)


class FieldFactors:
    """Log Bayes factor of a mixture of fields and sizes over none; what depends on the fields alone is computed once.

    `fields` (n, k).
    `sizes` (s,): factors on the columns of a field, all equally probable.
    `weights` (f,): log probability of each field; equal unless given.
    """

    def __init__(
        self, model: GaussianModel, fields: Sequence[Floats], sizes: Floats, weights: Floats | None = None
    ) -> None:
        self._model, self._sizes = model, sizes
        self._weights = np.full(len(fields), -np.log(len(fields))) if weights is None else weights
        widths = np.array([field.shape[1] for field in fields])
        self._ends = np.cumsum(widths)
        # all fields at once: one by one, thousands of small products take several times as long
        Z = model.standardised(np.concatenate(fields, axis=1))
        #: Of all fields the eigenvalues (k,) of their Gram matrices, and their principal directions (n, k).
        self._values, self._directions = np.empty(Z.shape[1]), Z
        for width in np.unique(widths).tolist():
            columns = self._ends[widths == width, None] + np.arange(-width, 0)
            of_width = Z[:, columns].transpose(1, 0, 2)
            values, vectors = np.linalg.eigh(of_width.transpose(0, 2, 1) @ of_width)
            self._values[columns] = np.maximum(values, 0.0)
            self._directions[:, columns] = (of_width @ vectors).transpose(1, 0, 2)

    def of(self, residuals: Floats) -> Floats:
        """Log Bayes factor (d,) of residuals (n, d)."""
        return self._of_standardised(self._model.standardised(residuals))

    def drawn(self, residual: Floats) -> Callable[[int, np.random.Generator], Floats]:
        """What draws so many log Bayes factors (d,) of rows of the model, the same in whatever axes and order rows are.

        Random numbers are coordinates along the eigenvectors of the mean quadratic form of the fields, each in the
        direction in which the residual (n,) lies: rows that are turned, mixed or split have these turned alike, and
        what they lack of these moves no factor.
        """
        widths = np.diff(self._ends, prepend=0)
        half = self._directions * np.sqrt(np.exp(np.repeat(self._weights, widths)) * self._ratios.mean(axis=0))
        form = half @ half.T
        vectors = own_axes(form, self._model.standardised(residual))

        def draw(count: int, random: np.random.Generator) -> Floats:
            return self._of_standardised(vectors @ random.normal(size=(len(vectors), count)))

        return draw

    @property
    def _ratios(self) -> Floats:
        """`s^2 / (1 + s^2 l)` of each size and direction (s, k)."""
        squares = self._sizes[:, None] ** 2
        return np.asarray(squares / (1.0 + squares * self._values))

    def _of_standardised(self, white: Floats) -> Floats:
        starts = np.concatenate([[0], self._ends[:-1]])
        volumes = np.add.reduceat(np.log1p(self._sizes[:, None] ** 2 * self._values), starts, axis=1)
        result = np.empty(white.shape[1])
        for first in range(0, white.shape[1], _TOGETHER):
            rows = white[:, first : first + _TOGETHER]
            squares = (self._directions.T @ rows) ** 2
            logs = [
                (self._weights - 0.5 * volume)[:, None] + 0.5 * np.add.reduceat(ratio[:, None] * squares, starts)
                for ratio, volume in zip(self._ratios, volumes, strict=True)
            ]
            result[first : first + _TOGETHER] = np.logaddexp.reduce(np.concatenate(logs))
        return result - np.log(len(self._sizes))


def own_axes(form: Floats, along: Floats) -> Floats:
    """Eigenvectors (k, k) of a quadratic form (k, k), the largest first, each in the direction of a vector (k,)."""
    vectors = np.linalg.eigh(form)[1][:, ::-1]
    return np.asarray(vectors * np.where(vectors.T @ along < 0.0, -1.0, 1.0))


def along_own_axes(model: GaussianModel, columns: Floats, residual: Floats) -> Floats:
    """Columns (n, k) of independent coefficients with one variance, mixed into ones that are the same in any axes.

    These are orthogonal where the model is `N(0, I)`, the longest first, and in the direction in which the residual
    (n,) lies.
    """
    Z = model.standardised(columns)
    return columns @ own_axes(Z.T @ Z, Z.T @ model.standardised(residual))


def predictive_p(
    model: GaussianModel,
    fields: Sequence[Floats],
    sizes: Floats,
    residual: Floats,
    draws: int,
    random: np.random.Generator,
    weights: Floats | None = None,
    levels: Sequence[float] = (),
    bound: float = 1.0,
) -> float:
    """Probability that the Bayes factor of the fields (`FieldFactors`) is as large in rows drawn from the model.

    `bound`: an upper bound on that probability; nothing is drawn if it is below the least p-value that draws can give.

    `draws` rows are drawn, and then as many again as there are, until the p-value is `_DEVIATIONS` standard errors away
    from each of the `levels` that it will be compared with; `_MOST_DRAWS` times `draws` at most.
    """
    if bound < 1.0 / (1 + _MOST_DRAWS * draws):
        # the generator is left as after drawing, so that later draws are the same
        random.spawn(1)
        return bound
    factors = FieldFactors(model, fields, sizes, weights)
    observed, draw, drawn = factors.of(residual[:, None])[0], factors.drawn(residual), np.zeros(0)
    while True:
        # each time with numbers of its own, however many rows there are
        [child] = random.spawn(1)
        drawn = np.concatenate([drawn, draw(max(draws, len(drawn)), child)])
        p = p_value(observed, drawn)
        uncertain = _DEVIATIONS * np.sqrt(p * (1.0 - p) / len(drawn))
        if all(abs(p - level) > uncertain for level in levels) or len(drawn) >= _MOST_DRAWS * draws:
            return min(p, bound)


def p_value(observed: float, drawn: Sequence[float] | Floats) -> float:
    """Share of values as large as an observed one, itself among them; those drawn (d,) are of the hypothesis."""
    return float((1 + np.sum(np.asarray(drawn) >= observed)) / (1 + len(drawn)))
