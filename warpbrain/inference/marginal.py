"""Marginal likelihood of rows under one hypothesis: summed over the scale of the noise and over gross errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.inference.gaussian import GaussianModel
from warpbrain.inference.gross_errors import (
    FurtherColumns,
    GrossErrors,
    PointRows,
    columns_of_inflation,
)
from warpbrain.inference.noise import outliers, scales

#: The sum over scales ends where a term is below this part of the largest.
_NEGLIGIBLE = 1e-3


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
    excess_columns: int  # how many columns the excess noise has

    @property
    def gross(self) -> Bools:
        """Points (g,) that are most probably gross errors."""
        return self.inflation > 1.0

    @cached_property
    def noise(self) -> GaussianModel:
        """Of the noise alone, with the excess noise of gross errors."""
        scaled = self.scale * self.model.noise_factor
        covariance = scaled @ scaled.T + self.excess @ self.excess.T
        factor: Floats = np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)
        return GaussianModel(factor, np.zeros((len(factor), 0)))

    def coordinates(self, residual: Floats) -> Floats:
        """Mean of the coefficients (q,) of the hypothesis after residuals (n,)."""
        return self.model.coefficients(residual)[0][: self._own_columns]

    @property
    def excess(self) -> Floats:
        """Columns (n, e) of the excess noise of gross errors."""
        return self.model.columns[:, self._own_columns :]

    @property
    def _own_columns(self) -> int:
        """How many columns the hypothesis has."""
        return self.model.columns.shape[1] - self.excess_columns


class RowsAtScales:
    """Evidence of rows under a model with further columns, whose length and the scale of the noise may vary.

    What neither changes is computed once.

    `model`: the causes of the hypothesis among its columns. `residual` (n,): less what is expected of the causes.
    `points`: rows of each point. `further` (n, k).
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

        `length`: that factor. `scale`: a factor on the noise near the most probable one, where the sum begins.
        `inflation` (g,): of gross errors under a hypothesis that is nearly the same.
        """
        values = self._values
        logs, inflations = np.full(len(values), -np.inf), [np.zeros(0)] * len(values)

        def add_scale(number: int, near: Floats | None) -> None:
            at_scale = self.with_gross_errors(float(values[number]), length, near)
            logs[number], inflations[number] = at_scale.log_density + self._log_prior[number], at_scale.inflation

        first = int(np.argmin(np.abs(np.log(values / scale))))
        add_scale(first, inflation)
        for step in (-1, 1):
            number = first + step
            while 0 <= number < len(values):
                add_scale(number, inflations[first])
                if logs[number] < logs.max() + np.log(_NEGLIGIBLE):
                    break
                number += step
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


def marginal_of(model: GaussianModel, points: Sequence[Ints], summed: Summed) -> Marginal:
    """Evidence and most probable model of a sum; `model` has the columns of the hypothesis, at a scale of one."""
    at_best = model.of_noise(model.columns, summed.scale)
    excess = columns_of_inflation(at_best, points, summed.inflation)
    with_excess = model.of_noise(np.column_stack([model.columns, excess]), summed.scale)
    return Marginal(summed.log_evidence, summed.scale, summed.inflation, with_excess, excess.shape[1])
