"""Temperature and offsets of log evidences that make the truth most likely."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

#: Weak normal priors of the logarithm of the temperature and of both offsets, for sets that do not tell one of them.
_SPREADS = np.array([1.5, 5.0, 5.0])


@dataclass(frozen=True)
class Scale:
    """What log evidences become probabilities by: ``softmax((log E + offset) / temperature)``.

    Attributes
    ----------
    temperature : float
    unknown, alternative : float
        Added to the log evidence of the unknown, and of what is no physics.
    """

    temperature: float
    unknown: float
    alternative: float


@dataclass(frozen=True, eq=False)
class Ballots:
    """Log evidences of cases in which something is missing.

    Attributes
    ----------
    evidence : (cases, kinds) array
        Minus infinity where a kind was not tried.
    right : (cases, kinds) bool array
        Whether a kind is true; in each case one that was tried is.
    unknown, alternative : (cases, kinds) bool arrays
        Which is the unknown, and which are no physics.
    """

    evidence: Floats
    right: Bools
    unknown: Bools
    alternative: Bools

    def __len__(self) -> int:
        return len(self.evidence)

    def of(self, rows: NDArray[np.int64]) -> Ballots:
        """Some cases, also several times."""
        return Ballots(self.evidence[rows], self.right[rows], self.unknown[rows], self.alternative[rows])

    def probabilities(self, scale: Scale) -> Floats:
        """Probability (cases, kinds) of each kind."""
        from scipy.special import softmax

        offset = scale.unknown * self.unknown + scale.alternative * self.alternative
        found: Floats = softmax((self.evidence + offset) / scale.temperature, axis=1)
        return found

    def loss(self, scale: Scale) -> float:
        """Mean of minus the logarithm of the probability of what is true."""
        true = (self.probabilities(scale) * self.right).sum(axis=1)
        return float(-np.log(np.maximum(true, 1e-300)).mean())


def fit(ballots: Ballots) -> Scale:
    """The scale of highest likelihood of the truth, with weak priors."""
    from scipy.optimize import minimize

    tried = np.isfinite(ballots.evidence)

    def cost(x: Floats) -> tuple[float, Floats]:
        scale = Scale(float(np.exp(x[0])), float(x[1]), float(x[2]))
        p = ballots.probabilities(scale)
        true = np.maximum((p * ballots.right).sum(axis=1, keepdims=True), 1e-300)
        # by the exponents of the softmax
        slope = p - p * ballots.right / true
        offset = scale.unknown * ballots.unknown + scale.alternative * ballots.alternative
        exponent = np.where(tried, ballots.evidence + offset, 0.0) / scale.temperature
        slopes = [-(slope * exponent).sum()]
        slopes += [(slope * flag).sum() / scale.temperature for flag in (ballots.unknown, ballots.alternative)]
        value = -np.log(true).sum() + 0.5 * ((x / _SPREADS) ** 2).sum()
        return float(value), np.array(slopes) + x / _SPREADS**2

    bounds = [(-3.0, 5.0), (-30.0, 30.0), (-30.0, 30.0)]
    found = minimize(cost, np.zeros(3), jac=True, method="L-BFGS-B", bounds=bounds)
    return Scale(float(np.exp(found.x[0])), float(found.x[1]), float(found.x[2]))


def held_out(ballots: Ballots, folds: int = 5) -> Floats:
    """Probabilities (cases, kinds) of each case by the scale that the other folds give."""
    place = np.random.default_rng(0).permutation(len(ballots)) % folds
    out = np.zeros_like(ballots.evidence)
    for fold in range(min(folds, len(ballots))):
        scale = fit(ballots.of(np.flatnonzero(place != fold)))
        rows = np.flatnonzero(place == fold)
        out[rows] = ballots.of(rows).probabilities(scale)
    return out


def intervals(ballots: Ballots, draws: int = 200) -> tuple[Scale, Scale]:
    """Ends of 95 % intervals, by fitting cases drawn with replacement."""
    random = np.random.default_rng(1)
    found = [fit(ballots.of(random.integers(len(ballots), size=len(ballots)))) for _ in range(draws)]
    values = np.array([(scale.temperature, scale.unknown, scale.alternative) for scale in found])
    low, high = np.percentile(values, [2.5, 97.5], axis=0).tolist()
    return Scale(*low), Scale(*high)


def conformal(p_values: Sequence[float], alpha: float) -> float | None:
    """An alarm below this p-value is false in at most a share `alpha` of cases like these, in which nothing is missing.

    The k-th smallest of n, with k the whole part of ``alpha (n + 1)`` (Vovk, Gammerman and Shafer 2005); None if there
    are too few.
    """
    k = int(alpha * (len(p_values) + 1) + 1e-9)
    return float(np.sort(np.asarray(p_values))[k - 1]) if k else None
