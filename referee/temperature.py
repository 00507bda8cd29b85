"""Temperature and weights of sets of causes that make the truth most likely."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from referee.diagnoses import NOT_PHYSICS, UNKNOWN, Tried

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

#: Traits of a set that have a log weight.
TRAITS = ("nothing", "another", UNKNOWN, NOT_PHYSICS)
#: Weak normal priors of the logarithm of the temperature, to 1, and of weights, to 0: a calibration set may not tell.
_SPREADS = np.array([0.7, *[3.0] * len(TRAITS)])


@dataclass(frozen=True)
class Scale:
    """What log densities become probabilities by: ``softmax((log p + weight) / temperature)``.

    Attributes
    ----------
    temperature : float
    weights : tuple of float
        Added for each of `TRAITS` that a set has, of `another` for each mechanism beyond the first.
    """

    temperature: float = 1.0
    weights: tuple[float, ...] = (0.0,) * len(TRAITS)

    def probabilities(self, hypotheses: Sequence[Tried]) -> Floats:
        """Of each hypothesis of one case."""
        from scipy.special import softmax

        log = np.array([one.log_density for one in hypotheses])
        found: Floats = softmax((log + traits(hypotheses) @ self.weights) / self.temperature)
        return found


def traits(hypotheses: Sequence[Tried]) -> Floats:
    """How often each hypothesis has each of `TRAITS`, (k, traits)."""
    rows = [
        (not h.causes, max(len(h.physics) - 1, 0), UNKNOWN in h.causes, NOT_PHYSICS in h.causes) for h in hypotheses
    ]
    return np.array(rows, dtype=np.float64).reshape(-1, len(TRAITS))


@dataclass(frozen=True, eq=False)
class Ballot:
    """A case: what was tried, and which of it is true.

    Attributes
    ----------
    hypotheses : tuple of Tried
    right : (k,) bool array
        At least one is.
    """

    hypotheses: tuple[Tried, ...]
    right: Bools


def log_loss(scale: Scale, ballots: Sequence[Ballot]) -> float:
    """Mean of minus the logarithm of the probability of what is true."""
    true = [scale.probabilities(b.hypotheses)[b.right].sum() for b in ballots]
    return float(-np.log(np.maximum(true, 1e-300)).mean())


def fit(ballots: Sequence[Ballot]) -> Scale:
    """The scale of highest likelihood of the truth, with weak priors to a temperature of 1 and weights of 0."""
    from scipy.optimize import minimize
    from scipy.special import softmax

    most = max(len(b.hypotheses) for b in ballots)
    log = np.full((len(ballots), most), -np.inf)
    has, right = np.zeros((*log.shape, len(TRAITS))), np.zeros(log.shape, dtype=bool)
    for k, ballot in enumerate(ballots):
        own = np.array([h.log_density for h in ballot.hypotheses])
        # what is common to all of a case does not matter
        log[k, : len(own)], has[k, : len(own)] = own - own.max(), traits(ballot.hypotheses)
        right[k, : len(own)] = ballot.right
    tried = np.isfinite(log)

    def cost(x: Floats) -> tuple[float, Floats]:
        temperature = np.exp(x[0])
        exponent = (log + has @ x[1:]) / temperature
        p = softmax(exponent, axis=1)
        true = np.maximum((p * right).sum(axis=1, keepdims=True), 1e-300)
        by_exponent = p - p * right / true
        slope = np.array(
            [
                -(by_exponent * np.where(tried, exponent, 0.0)).sum(),
                *np.einsum("ck,ckt->t", by_exponent, has) / temperature,
            ]
        )
        return float(-np.log(true).sum() + 0.5 * ((x / _SPREADS) ** 2).sum()), slope + x / _SPREADS**2

    bounds = [(-3.0, 5.0), *[(-30.0, 30.0)] * len(TRAITS)]
    found = minimize(cost, np.zeros(len(_SPREADS)), jac=True, method="L-BFGS-B", bounds=bounds)
    return Scale(float(np.exp(found.x[0])), tuple(found.x[1:].tolist()))


def held_out(ballots: Sequence[Ballot], folds: int = 5) -> list[Floats]:
    """Probabilities of each case by the scale that the other folds give."""
    place = np.random.default_rng(0).permutation(len(ballots)) % folds
    scales = {fold: fit([b for b, k in zip(ballots, place, strict=True) if k != fold]) for fold in set(place.tolist())}
    return [scales[fold].probabilities(b.hypotheses) for b, fold in zip(ballots, place.tolist(), strict=True)]


def intervals(ballots: Sequence[Ballot], draws: int = 100) -> Floats:
    """Ends (2, 1 + traits) of 95 % intervals of temperature and weights, by fitting cases drawn with replacement."""
    random = np.random.default_rng(1)
    found = []
    for _ in range(draws):
        scale = fit([ballots[k] for k in random.integers(len(ballots), size=len(ballots))])
        found.append((scale.temperature, *scale.weights))
    return np.percentile(np.array(found), [2.5, 97.5], axis=0)
