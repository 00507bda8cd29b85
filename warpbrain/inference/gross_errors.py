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
    log_prior_odds = np.log(prior.probability) - np.log1p(-prior.probability)
    noise = model.scale**2 * model.noise_factor @ model.noise_factor.T
    added = [(prior.inflation**2 - 1.0) * noise[np.ix_(rows, rows)] for rows in points]
    covariance = model.covariance
    gross = np.zeros(len(points), dtype=bool)
    for _ in range(sweeps * max(len(points), 1)):
        precision: Floats = np.asarray(np.linalg.inv(covariance), dtype=np.float64)
        weighted = precision @ residual
        odds = log_prior_odds + np.array(
            [
                _log_ratio(weighted[rows], precision[np.ix_(rows, rows)], extra, there)
                for rows, extra, there in zip(points, added, gross.tolist(), strict=True)
            ]
        )
        wrong = np.where((odds > 0.0) != gross, np.abs(odds), 0.0)
        if not wrong.any():
            break
        worst = int(np.argmax(wrong))
        rows = points[worst]
        covariance = covariance.copy()
        covariance[np.ix_(rows, rows)] += added[worst] * (-1.0 if gross[worst] else 1.0)
        gross[worst] = not gross[worst]
    log_density = -0.5 * (
        float(residual @ weighted) + float(np.linalg.slogdet(covariance)[1]) + len(residual) * np.log(2.0 * np.pi)
    )
    count = int(np.count_nonzero(gross))
    log_indicators = count * np.log(prior.probability) + (len(points) - count) * np.log1p(-prior.probability)
    others = np.log1p(np.exp(-np.abs(odds))).sum()
    return GrossErrors(float(log_density + log_indicators + others), odds)


def _log_ratio(v: Floats, P: Floats, extra: Floats, there: bool) -> float:
    """Log density with larger noise of a point less that without, from the inverse covariance as it is now."""
    sign = -1.0 if there else 1.0
    middle = np.linalg.inv(sign * np.linalg.inv(extra) + P)
    volume = float(np.linalg.slogdet(np.eye(len(v)) + sign * extra @ P)[1])
    return sign * (0.5 * float(v @ middle @ v) - 0.5 * volume)
