"""The temperature of sets of causes that makes the truth most likely.

How often something is missing in a made set, and how often it is unknown, was chosen by who made it, and says nothing
about anybody else's recordings: weights of sets are fitted beside the temperature, which would otherwise have to make
up for them, and are not kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from referee.diagnoses import NOT_PHYSICS, UNKNOWN, Tried

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

#: Traits of a set that have a log weight.
TRAITS = ("nothing", "another", UNKNOWN, NOT_PHYSICS)
#: Weak normal prior of the logarithm of the temperature, about 0, and of the weights: a set may not tell.
_SPREAD, _SPREAD_OF_WEIGHTS = 0.7, 2.0


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
        return self.of_densities(np.array([tried.log_density for tried in hypotheses]), traits(hypotheses))

    def of_densities(self, log_densities: Floats, traits: Floats) -> Floats:
        """The same from log densities (k,) and `traits` (k, traits)."""
        from scipy.special import softmax

        return np.asarray(softmax((log_densities + traits @ self.weights) / self.temperature))


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

    @cached_property
    def densities(self) -> tuple[Floats, Floats]:
        """Log densities (k,) and `traits` (k, traits) of its hypotheses."""
        return np.array([tried.log_density for tried in self.hypotheses]), traits(self.hypotheses)


def log_loss(scale: Scale, ballots: Sequence[Ballot]) -> float:
    """Mean of minus the logarithm of the probability of what is true."""
    return _Together.of(ballots).log_loss(scale)


@dataclass(frozen=True, eq=False)
class _Together:
    """Hypotheses (n,) of all cases, one after the other, and where those of each case begin."""

    log_densities: Floats
    traits: Floats
    right: Bools
    first: NDArray[np.intp]

    @classmethod
    def of(cls, ballots: Sequence[Ballot]) -> _Together:
        log_densities, of_traits = zip(*(ballot.densities for ballot in ballots), strict=True)
        count = [len(ballot.right) for ballot in ballots]
        right = np.concatenate([ballot.right for ballot in ballots])
        return cls(np.concatenate(log_densities), np.concatenate(of_traits), right, np.cumsum([0, *count[:-1]]))

    def log_loss(self, scale: Scale) -> float:
        logits = (self.log_densities + self.traits @ scale.weights) / scale.temperature
        count = np.diff(self.first, append=len(logits))
        p = np.exp(logits - np.repeat(np.maximum.reduceat(logits, self.first), count))
        true = np.add.reduceat(p * self.right, self.first) / np.add.reduceat(p, self.first)
        return float(-np.log(np.maximum(true, 1e-300)).mean())


def fit(ballots: Sequence[Ballot]) -> Scale:
    """The scale with the temperature of highest likelihood of the truth, and no weights.

    The likelihood is that with weights of the set the cases are of.
    """
    from scipy.optimize import minimize

    together = _Together.of(ballots)

    def cost(point: Floats) -> float:
        scale = Scale(float(np.exp(point[0])), tuple(point[1:].tolist()))
        prior = (point[0] / _SPREAD) ** 2 + np.sum((point[1:] / _SPREAD_OF_WEIGHTS) ** 2)
        return len(ballots) * together.log_loss(scale) + 0.5 * float(prior)

    best = minimize(
        cost, np.zeros(1 + len(TRAITS)), method="L-BFGS-B", bounds=[(-3.0, 5.0), *[(-8.0, 8.0)] * len(TRAITS)]
    )
    return Scale(float(np.exp(best.x[0])))


def held_out(ballots: Sequence[Ballot], folds: int = 5) -> list[Floats]:
    """Probabilities of each case by the scale that the other folds give."""
    place = np.random.default_rng(0).permutation(len(ballots)) % folds
    scales = {fold: fit([b for b, k in zip(ballots, place, strict=True) if k != fold]) for fold in set(place.tolist())}
    return [scales[fold].probabilities(b.hypotheses) for b, fold in zip(ballots, place.tolist(), strict=True)]


def interval(ballots: Sequence[Ballot], draws: int = 100) -> tuple[float, float]:
    """Ends of the 95 % interval of the temperature, by fitting cases drawn with replacement."""
    random = np.random.default_rng(1)
    temperatures = [
        fit([ballots[k] for k in random.integers(len(ballots), size=len(ballots))]).temperature for _ in range(draws)
    ]
    low, high = np.percentile(temperatures, [2.5, 97.5]).tolist()
    return low, high
