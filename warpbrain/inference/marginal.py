"""The marginal likelihood of a hypothesis: its density with gross errors, summed over the scale of the noise.

Scales begin at the most probable one of a hypothesis that is nearly the same, and go outward as far as they matter.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.inference.gaussian import GaussianModel
from warpbrain.inference.gross_errors import (
    FurtherColumns,
    GrossErrors,
    PointNoise,
    PointRows,
    columns_of_inflation,
    noise_with_excess,
)
from warpbrain.inference.noise import outliers, scales

#: The sum over scales ends where a term is below this part of the largest.
_NEGLIGIBLE = 1e-3
#: Log density [nats] that other gross errors may add at a neighbouring scale: much more than makes a term negligible.
_BY_OTHER_GROSS_ERRORS = -3.0 * math.log(_NEGLIGIBLE)


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
        return noise_with_excess(self.model, self.excess)

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
        self._model, self._residual, self._noise = model, residual, PointNoise.of(model, points)
        self._further = np.zeros((len(residual), 0)) if further is None else further
        self._values, self._log_prior = scales()
        self._weighted = model.precision_at(np.column_stack([residual, self._further]))
        self._at: dict[float, tuple[PointRows, FurtherColumns]] = {}

    def summed(self, length: float = 1.0, scale: float = 1.0, inflation: Floats | None = None) -> Summed:
        """The evidence with the further columns multiplied by a factor.

        `length`: that factor.
        `scale`: a factor on the noise near the most probable one, where the sum begins.
        `inflation` (g,): of gross errors under a hypothesis that is nearly the same.
        """
        values, log_prior = self._values, self._log_prior
        first = int(np.argmin(np.abs(np.log(values / scale))))
        at: dict[int, GrossErrors] = {}

        def log_density(number: int) -> float:
            start = at[first].inflation if first in at else inflation
            at[number] = self.with_gross_errors(float(values[number]), length, start)
            return at[number].log_density + float(log_prior[number])

        def at_most(number: int, neighbour: int) -> float:
            change = self._change_of_density(at[neighbour], length, float(values[number] / values[neighbour]))
            return at[neighbour].log_density + change + _BY_OTHER_GROSS_ERRORS + float(log_prior[number])

        logs = outward(log_density, first, len(values), _NEGLIGIBLE, at_most)
        best = int(np.argmax(logs))
        return Summed(float(np.logaddexp.reduce(logs)), float(values[best]), at[best].inflation)

    def with_gross_errors(self, scale: float, length: float = 1.0, start: Floats | None = None) -> GrossErrors:
        """Density at one scale of the noise, with the further columns multiplied by `length`."""
        if scale not in self._at:
            weighted = self._weighted(scale)
            rows = PointRows(self._model.with_scale(scale), self._residual, self._noise, weighted[:, 0])
            self._at[scale] = rows, FurtherColumns(self._further, weighted[:, 1:])
        rows, further = self._at[scale]
        return rows.with_gross_errors(outliers(), start, further, length)

    def _change_of_density(self, known: GrossErrors, length: float, ratio: float) -> float:
        """Change [nats] of the log density where the noise is `ratio` times as large, with the same gross errors.

        It is `(1 - 1 / ratio^2) A / 2 - m ln(ratio)`, as long as columns explain as much. `A`: square of what is left
        of the rows, in standard deviations of the noise. `m`: degrees of freedom of the noise, between the number of
        rows and that less the number of columns; that of which the change is the larger.
        """
        v = known.weighted
        explained = np.sum((v @ self._model.columns) ** 2) + length**2 * np.sum((v @ self._further) ** 2)
        square = float(v @ self._residual - explained)
        columns = self._model.columns.shape[1] + self._further.shape[1]
        freedom = len(v) if ratio < 1.0 else max(len(v) - columns, 0)
        return 0.5 * (1.0 - ratio**-2) * square - freedom * math.log(ratio)


def outward(
    log_evidence: Callable[[int], float],
    first: int,
    count: int,
    negligible: float,
    at_most: Callable[[int, int], float] | None = None,
) -> Floats:
    """Log evidence (count,) by number, as far from the first one as it is not below a part of the largest.

    `at_most`: a bound on the log evidence of a number, by that number and a neighbour whose log evidence is known.
    """
    logs = np.full(count, -np.inf)
    logs[first] = log_evidence(first)
    least = np.log(negligible)
    for step in (-1, 1):
        number = first + step
        while 0 <= number < count:
            if at_most is not None and at_most(number, number - step) < logs.max() + least:
                break
            logs[number] = log_evidence(number)
            if logs[number] < logs.max() + least:
                break
            number += step
    return logs


def marginal_of(model: GaussianModel, points: Sequence[Ints], summed: Summed) -> Marginal:
    """Evidence and most probable model of a sum; `model` has the columns of the hypothesis, at a scale of one."""
    at_best = model.of_noise(model.columns, summed.scale)
    excess = columns_of_inflation(at_best, points, summed.inflation)
    with_excess = model.of_noise(np.column_stack([model.columns, excess]), summed.scale)
    return Marginal(summed.log_evidence, summed.scale, summed.inflation, with_excess, model.columns.shape[1])
