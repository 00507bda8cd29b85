"""How much of the evidence of a hypothesis rests on single points, which may be gross errors.

A force near one point explains whatever was recorded there. So each point is taken for a gross error with a small
probability `e`: what it is then has a wide distribution `q`, and says nothing. To first order in each point the
evidence is multiplied by

    prod_g (1 + e q(r_g) / p(r_g | all others)),

where `p` is what the others say of the point under the hypothesis: a block of the inverse of the covariance. What
stands out far beyond any smooth force was set aside before; see `gross_errors`.

The factor `kappa` on the noise is averaged over with these factors in place, not before: one gross error would make it
large, and whatever explains that one point would be credited with the noise of all others. Factors at which more than
a quarter of the points would be gross errors do not count: to first order each of them is compared with all others as
if these were sound, and a noise that is three times what was declared would be a small one with gross errors all over.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.evidence import KAPPAS, Explanation, kappa_log_prior
from warpbrain.threads import in_threads
from warpbrain.worlds.body.sensors import Sensors, rows_of_points

Floats = NDArray[np.float64]

#: Probability that a point is a gross error, and how large one is in standard deviations of the noise.
OFTEN, LARGE = 0.03, 8.0
#: Part of the points of which more are no gross errors, but noise.
_MOST = 0.25


def log_evidence_and_odds(
    sensors: Sensors, explanation: Explanation, residual: Floats, kappas: Floats = KAPPAS
) -> tuple[float, Floats]:
    """Log evidence of a linear model where any point may be a gross error, and the odds (n,) of `log_odds`.

    Parameters
    ----------
    sensors : Sensors
    explanation : Explanation
    residual : (n,) array
        With all nuisances at zero, not whitened.
    kappas : (k,) array
        Factors on the noise that are averaged over.

    Returns
    -------
    (float, (n,) array)
        Odds are those at the most probable factor.
    """
    from scipy.special import logsumexp

    at = partial(log_odds, sensors, explanation, residual)
    # with the first the explanation makes what the others need of it, too
    odds = np.array([*map(at, kappas[:1].tolist()), *in_threads(at, kappas[1:].tolist())])
    first = np.unique(sensors.groups, return_index=True)[1]
    gains = np.logaddexp(0.0, odds[:, first]).sum(axis=1)
    logs = explanation.log_none(explanation.whitened(residual)[:, None], kappas)[:, 0] + kappa_log_prior(kappas) + gains
    few = np.mean(odds[:, first] > 0.0, axis=1) <= _MOST
    if few.any():
        logs[~few] = -np.inf
    return float(logsumexp(logs)), odds[int(np.argmax(logs))]


def gain_of_gross_errors(sensors: Sensors, explanation: Explanation, residual: Floats) -> float:
    """What the log evidence of a linear model gains where any point may be a gross error."""
    plain = float(explanation.log_marginal(explanation.whitened(residual)[:, None])[0])
    return log_evidence_and_odds(sensors, explanation, residual)[0] - plain


def log_odds(sensors: Sensors, explanation: Explanation, residual: Floats, kappa: float) -> Floats:
    """Logarithm of the odds (n,) that the point of each row is a gross error, after what all others say of it.

    Minus infinity for forces: nobody pairs them wrongly. That one was not measured as it should be is what competes
    with mechanisms; see `warpbrain.worlds.body.not_physics`.

    Parameters
    ----------
    sensors : Sensors
    explanation : Explanation
    residual : (n,) array
        With all nuisances at zero, not whitened.
    kappa : float
        Factor on the noise.
    """
    weighted = explanation.inverse_times(residual, kappa)
    found = np.full(len(sensors), -np.inf)
    for rows in rows_of_points(sensors):
        own = explanation.inverse_blocks(rows, kappa)
        covariance = np.linalg.inv(own)
        apart = np.einsum("gij,gj->gi", covariance, weighted[rows])
        factors = explanation.factor[rows]
        wide = covariance + (LARGE**2 - 1.0) * kappa**2 * np.einsum("gin,gjn->gij", factors, factors)
        likely = -0.5 * np.einsum("gi,gij,gj->g", apart, own, apart) + 0.5 * np.linalg.slogdet(own)[1]
        gross = -0.5 * np.einsum("gi,gi->g", apart, np.linalg.solve(wide, apart[:, :, None])[:, :, 0])
        gross -= 0.5 * np.linalg.slogdet(wide)[1]
        found[rows] = (np.log(OFTEN) + gross - likely)[:, None]
    return found
