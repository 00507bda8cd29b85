"""Checks of a model by itself: what it predicts of rows it has not seen, and whether what is left looks like its noise.

With `P = S^-1` the rows of a block given all others have the mean `r_b - P_bb^-1 (P r)_b` and the covariance `P_bb^-1`:
exactly what conditioning the model on the others gives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.inference.gaussian import GaussianModel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Prediction:
    """Every block of rows predicted from all others.

    Attributes
    ----------
    errors : (n,) array
        What was recorded less what was predicted.
    blocks : (n,) int array
    log_densities : (b,) array
        Of each block given the others.
    """

    errors: Floats
    blocks: Ints
    log_densities: Floats

    def improvement(
        self, over: Prediction, rows: NDArray[np.bool_], random: np.random.Generator, draws: int = 2000
    ) -> tuple[float, float, float]:
        """Part of another's root mean square error that is gone, and its 95 % interval by bootstrap over blocks."""
        names = np.unique(self.blocks[rows])
        own = np.array([np.sum(self.errors[rows & (self.blocks == b)] ** 2) for b in names])
        other = np.array([np.sum(over.errors[rows & (self.blocks == b)] ** 2) for b in names])
        chosen = random.integers(len(names), size=(draws, len(names)))
        parts = 1.0 - np.sqrt(own[chosen].sum(axis=1) / np.maximum(other[chosen].sum(axis=1), 1e-300))
        low, high = np.quantile(parts, [0.025, 0.975])
        return float(1.0 - np.sqrt(own.sum() / max(other.sum(), 1e-300))), float(low), float(high)

    def gain(self, over: Prediction) -> float:
        """By how much [nats] the blocks are more probable than under another."""
        return float(np.sum(self.log_densities - over.log_densities))


def predict(model: GaussianModel, residual: Floats, blocks: Ints) -> Prediction:
    """Predict every block of rows.

    Parameters
    ----------
    model : GaussianModel
    residual : (n,) array
    blocks : (n,) int array
    """
    weighted = model.precision_times(residual)
    errors, densities = np.zeros(len(residual)), []
    for block in np.unique(blocks):
        rows = np.flatnonzero(blocks == block)
        L = np.linalg.cholesky(model.precision_columns(rows)[rows])
        white = np.linalg.solve(L, weighted[rows])
        errors[rows] = np.linalg.solve(L.T, white)
        densities.append(np.log(np.diag(L)).sum() - 0.5 * float(white @ white) - 0.5 * len(rows) * np.log(2.0 * np.pi))
    return Prediction(errors, blocks, np.array(densities))


def log_factors_of_fields(model: GaussianModel, fields: Sequence[Floats], sizes: Floats, residuals: Floats) -> Floats:
    """Log Bayes factor (d,) of any of some fields, of any size, against none.

    Parameters
    ----------
    model : GaussianModel
    fields : sequence of (n, k) arrays
    sizes : (s,) array
        Factors on the columns of a field, all alike probable.
    residuals : (n, d) array
    """
    white = model.standardised(residuals)
    logs = []
    for field in fields:
        Z = model.standardised(field)
        values, vectors = np.linalg.eigh(Z.T @ Z)
        values = np.maximum(values, 0.0)
        squares = ((Z @ vectors).T @ white) ** 2
        for size in sizes.tolist():
            ratio = size**2 / (1.0 + size**2 * values)
            logs.append(0.5 * (ratio @ squares) - 0.5 * float(np.log1p(size**2 * values).sum()))
    return np.asarray(np.logaddexp.reduce(logs, axis=0) - np.log(len(logs)))


def predictive_p(
    model: GaussianModel,
    fields: Sequence[Floats],
    sizes: Floats,
    residual: Floats,
    draws: int,
    random: np.random.Generator,
) -> float:
    """Probability that a field without a name would seem as probable in rows drawn from the model; see above."""
    drawn = np.column_stack([residual, model.draws(draws, random)])
    statistic = log_factors_of_fields(model, fields, sizes, drawn)
    return float((1 + np.sum(statistic[1:] >= statistic[0])) / (1 + draws))
