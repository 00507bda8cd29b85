"""How much of the stress relaxes in all: averaged over the times in which it may, one or two, as they are probable.

A few recorded times hardly tell in how many times stress relaxes, and next to nothing of what has relaxed before the
first of them. How much relaxes in all depends on both: a fit with one time knows it to a few percent, and so does a fit
with two, at twice as much. So the amount is that of all hypotheses of the scan, with the coefficients that each may
have beforehand. About a refit the sensors depend on them through few numbers, what is there at each recorded time:

    log p(c) = log prior(c) + h^T a - 1/2 a^T G a,     a = seen(c) - seen(c of the fit),   by time
    G = D^T S^-1 D,    h = D^T S^-1 r

`D` is what is there at once, a column for each time, `S` the covariance of noise and nuisances, `r` what the fit leaves
with all nuisances in the middle of their prior, and `seen` of `Effects`: as much less movement as there is stiffness.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.evidence import Explanation
from warpbrain.diagnosis.refitting import Refit
from warpbrain.physics.proposal import Proposal
from warpbrain.worlds.body.effects import Effect, faded
from warpbrain.worlds.body.sensors import Sensors

Floats = NDArray[np.float64]

#: Draws of the other coefficients of each proposal; amounts that each is tried with, as parts of the standard deviation
#: beforehand, and how many: closer to each other than any data tell them apart.
_DRAWS = 300
_LEAST, _MOST, _AMOUNTS = 1e-3, 5.0, 200
#: The least part of all that relaxes which does so between the first and the last recording. Of what relaxes before or
#: after, anything may be there: it is not counted.
_SEEN = 0.25


@dataclass(frozen=True, eq=False)
class _Moment:
    """Numbers that were recorded at one time [s], all of displacements or all of forces; which rows (n,) these are."""

    time: float
    rows: NDArray[np.bool_]
    is_displacement: bool


def amount_in_all(effects: Sequence[Effect], fit: Refit, number: int, factor: Floats) -> tuple[float, float]:
    """How much fades in all, and its standard deviation: mean and spread of its logarithm.

    Parameters
    ----------
    effects : sequence of Effect
        All that the scan has of the kind.
    fit : Refit
    number : int
        Of the effect of this fit which is of that kind.
    factor : (n, n) array
        Of the noise.
    """
    from scipy.special import logsumexp

    moments = _moments(fit.state.sensors)
    best, z = fit.effects[number], fit.coefficients[number]
    here = best.coefficients(z)
    at_once = _at_once(fit, number, moments)
    G, h = _likelihood(fit, number, factor, np.column_stack([np.where(one.rows, at_once, 0.0) for one in moments]))
    there = _seen(_parts(best.proposed, here[None], moments), moments)[0]
    rng = np.random.default_rng(0)
    log_weights, means, squares = [], [], []
    for effect in effects:
        proposal = effect.proposed
        amounts, log_prior = _amounts(proposal)
        parts = _parts(proposal, _drawn(proposal, rng), moments)
        times = [one.time for one in moments]
        parts = parts[parts[:, np.argmin(times)] - parts[:, np.argmax(times)] >= _SEEN]
        if not len(parts):
            continue
        away = _seen(parts[:, None] * amounts[:, None], moments) - there
        log = away @ h - 0.5 * np.einsum("dai,ij,daj->da", away, G, away, optimize=True) + log_prior
        log_weights.append(logsumexp(log))
        chances = np.exp(log - log_weights[-1]).sum(axis=0)
        means.append(chances @ np.log(amounts))
        squares.append(chances @ np.log(amounts) ** 2)
    if not log_weights:
        return float(here[0]), float(best.proposed.sd[0] * np.sqrt(fit.covariances[number][0, 0]))
    weights = np.exp(np.array(log_weights) - logsumexp(log_weights))
    mean = float(weights @ means)
    amount = float(np.exp(mean))
    return amount, amount * float(np.sqrt(max(weights @ squares - mean**2, 0.0)))


def _moments(sensors: Sensors) -> list[_Moment]:
    found = []
    for time in np.unique(sensors.times[np.isfinite(sensors.times)]).tolist():
        for moves in (True, False):
            rows = (sensors.times == time) & (sensors.is_displacement == moves)
            if rows.any():
                found.append(_Moment(time, rows, moves))
    return found


def _drawn(proposal: Proposal, rng: np.random.Generator) -> Floats:
    """Coefficients (draws, k) of a whole one."""
    found = proposal.mean + proposal.sd * rng.normal(size=(_DRAWS, len(proposal)))
    found[:, 0] = 1.0
    return np.asarray(found)


def _parts(proposal: Proposal, coefficients: Floats, moments: Sequence[_Moment]) -> Floats:
    """How many times what is there at once is there (draws, moments)."""
    assert proposal.history is not None
    return np.array([[proposal.history(c, one.time) for one in moments] for c in coefficients])


def _seen(parts: Floats, moments: Sequence[_Moment]) -> Floats:
    return faded(parts, np.array([one.is_displacement for one in moments]))


def _amounts(proposal: Proposal) -> tuple[Floats, Floats]:
    """First coefficients (a,) that a proposal is tried with, and the logarithm of what each counts beforehand."""
    from scipy.special import logsumexp

    sd = float(proposal.sd[0])
    amounts = sd * np.geomspace(_LEAST, _MOST, _AMOUNTS)
    # steps are even in the logarithm
    log = np.log(amounts) - 0.5 * ((amounts - float(proposal.mean[0])) / sd) ** 2
    return amounts, log - logsumexp(log)


def _own(fit: Refit, number: int) -> slice:
    """Columns of an effect of a fit."""
    first = len(fit.nuisances) + sum(len(z) for z in fit.coefficients[:number])
    return slice(first, first + len(fit.coefficients[number]))


def _at_once(fit: Refit, number: int, moments: Sequence[_Moment]) -> Floats:
    """What is there at once (n,): that of the scan, as large as the columns of the fit have it."""
    best, here = fit.effects[number], fit.effects[number].coefficients(fit.coefficients[number])
    assert best.lasting is not None
    parts = _parts(best.proposed, here[None], moments)[0]
    # by the amount, to first order
    step = 1e-3
    slopes = (_seen((1.0 + step) * parts, moments) - _seen((1.0 - step) * parts, moments)) / (2.0 * step * here[0])
    rows = np.array([one.rows for one in moments])
    expected = best.lasting[:, 0] * (slopes @ rows) * best.proposed.sd[0]
    first = fit.columns[:, _own(fit, number).start]
    return np.asarray(best.lasting[:, 0] * float(expected @ first) / float(expected @ expected))


def _likelihood(fit: Refit, number: int, factor: Floats, D: Floats) -> tuple[Floats, Floats]:
    """`G` (m, m) and `h` (m,) of columns (n, m)."""
    own = _own(fit, number)
    explanation = Explanation(factor, np.delete(fit.columns, own, axis=1))
    left = fit.linear - fit.columns[:, own] @ fit.coefficients[number]
    white = explanation.whitened(D)
    weighted = explanation.precision_times(white, fit.kappa)
    return np.asarray(white.T @ weighted), np.asarray(weighted.T @ explanation.whitened(left))
