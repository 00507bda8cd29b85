"""Marginal likelihood of rows under one hypothesis: summed over the scale of the noise and over gross errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.inference.gaussian import GaussianModel
from warpbrain.inference.gross_errors import Sound, columns_of_inflation, with_gross_errors
from warpbrain.inference.noise import outliers, scales

#: The sum over scales ends where a term is below this part of the largest.
_NEGLIGIBLE = 1e-3


@dataclass(frozen=True, eq=False)
class Marginal:
    """Rows under one hypothesis.

    Attributes
    ----------
    log_evidence : float
    scale : float
        The most probable factor on the noise.
    inflation : (g,) array
        Most probable factor on the noise of each point at that scale, 1 of sound ones.
    model : GaussianModel
        At that scale; the excess noise of these points is columns after those of the hypothesis.
    excess_columns : int
        How many columns the excess noise has.
    """

    log_evidence: float
    scale: float
    inflation: Floats
    model: GaussianModel
    excess_columns: int

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


def marginal(
    model: GaussianModel,
    residual: Floats,
    points: Sequence[Ints],
    scale: float = 1.0,
    inflation: Floats | None = None,
) -> Marginal:
    """Evidence of residuals (n,).

    Parameters
    ----------
    model : GaussianModel
        The causes of the hypothesis among its columns.
    residual : (n,) array
        Less what is expected of the causes.
    points : sequence of int arrays
        Rows of each point.
    scale : float
        A factor on the noise near the most probable one, where the sum begins.
    inflation : (g,) array, optional
        Of gross errors under a hypothesis that is nearly the same.
    """
    values, log_prior = scales()
    logs = np.full(len(values), -np.inf)
    inflations: dict[int, Floats] = {}
    sound = tuple(Sound.at_scales(model, values, residual))

    def add_scale(number: int) -> None:
        scaled = model.with_scale(float(values[number]))
        at_scale = with_gross_errors(scaled, residual, points, outliers(), start=inflation, sound=sound[number])
        logs[number], inflations[number] = at_scale.log_density + log_prior[number], at_scale.inflation

    first = int(np.argmin(np.abs(np.log(values / scale))))
    add_scale(first)
    for step in (-1, 1):
        number = first + step
        while 0 <= number < len(values):
            add_scale(number)
            if logs[number] < logs.max() + np.log(_NEGLIGIBLE):
                break
            number += step
    best = int(np.argmax(logs))
    at_best = model.with_scale(float(values[best]))
    columns = columns_of_inflation(at_best, points, inflations[best])
    return Marginal(
        float(np.logaddexp.reduce(logs)),
        at_best.scale,
        inflations[best],
        at_best.with_columns(columns),
        columns.shape[1],
    )
