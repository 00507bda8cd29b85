"""How much of the evidence of a hypothesis rests on single points, which may be gross errors.

A force near one point explains whatever was recorded there. So each point is taken for a gross error with a small
probability `e`: what it is then has a wide distribution `q`, and says nothing. To first order in each point the
evidence is multiplied by

    prod_g (1 + e q(r_g) / p(r_g | all others)),

where `p` is what the others say of the point under the hypothesis: a block of the inverse of the covariance. What
stands out far beyond any smooth force was set aside before; see `gross_errors`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.sensors import Sensors

Floats = NDArray[np.float64]

#: Probability that a point is a gross error, and how large one is in standard deviations of the noise.
OFTEN, LARGE = 0.03, 8.0


def log_gross(sensors: Sensors, factor: Floats, columns: Floats, residual: Floats, kappa: float) -> float:
    """What the log evidence of a linear model gains where any point may be a gross error; see `log_odds`."""
    return log_gain(sensors, log_odds(sensors, factor, columns, residual, kappa))


def log_gain(sensors: Sensors, odds: Floats) -> float:
    """The same where the odds (n,) of `log_odds` are known."""
    return float(np.logaddexp(0.0, odds[np.unique(sensors.groups, return_index=True)[1]]).sum())


def log_odds(sensors: Sensors, factor: Floats, columns: Floats, residual: Floats, kappa: float) -> Floats:
    """Logarithm of the odds (n,) that the point of each row is a gross error, after what all others say of it.

    Parameters
    ----------
    sensors : Sensors
    factor : (n, n) array
        Of the noise, lower triangular.
    columns : (n, q) array
        Of one standard deviation each.
    residual : (n,) array
        With all of them at zero.
    kappa : float
        Factor on the noise.
    """
    noise = kappa**2 * factor @ factor.T
    precision = np.linalg.inv(noise + columns @ columns.T)
    weighted = precision @ residual
    sizes = np.bincount(sensors.groups)
    found = np.zeros(len(sensors))
    order = np.argsort(sensors.groups, kind="stable")
    for size in np.unique(sizes[sizes > 0]).tolist():
        rows = order[np.isin(sensors.groups[order], np.flatnonzero(sizes == size))].reshape(-1, size)
        own = precision[rows[:, :, None], rows[:, None, :]]
        covariance = np.linalg.inv(own)
        apart = np.einsum("gij,gj->gi", covariance, weighted[rows])
        wide = covariance + (LARGE**2 - 1.0) * noise[rows[:, :, None], rows[:, None, :]]
        likely = -0.5 * np.einsum("gi,gij,gj->g", apart, own, apart) + 0.5 * np.linalg.slogdet(own)[1]
        gross = -0.5 * np.einsum("gi,gi->g", apart, np.linalg.solve(wide, apart[:, :, None])[:, :, 0])
        gross -= 0.5 * np.linalg.slogdet(wide)[1]
        found[rows] = (np.log(OFTEN) + gross - likely)[:, None]
    return found
