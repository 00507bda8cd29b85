"""Tissue averaged over what may act on a body: that of each set of causes, weighed by the probability of the set.

With the probability `P(S)` of each set S, and mean `m_S` and covariance `C_S` of the tissue in the linear model with S,

    p(theta) = sum P(S) N(theta; m_S, C_S),  m = sum P(S) m_S,  C = sum P(S) (C_S + (m_S - m) (m_S - m)^T)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.estimation.parameters import Parameters
from warpbrain.inference.causes import Kind
from warpbrain.worlds.body.hypotheses import HypothesisSearch


@dataclass(frozen=True)
class LikelyCause:
    """Something that may act, and the probability that it does, whatever else acts."""

    name: str
    kind: Kind
    probability: float


@dataclass(frozen=True, eq=False)
class AveragedTissue:
    """A mixture of normal distributions of `theta`, one for each set of causes."""

    parameters: Parameters  # what `theta` means
    nothing: float  # probability that nothing acts but what the case says
    causes: tuple[LikelyCause, ...]  # the most probable first
    probabilities: Floats  # (s,), of the sets
    means: Floats  # (s, p)
    covariances: Floats  # (s, p, p)

    @property
    def mean(self) -> Floats:
        """Of `theta`, shape (p,)."""
        return self.probabilities @ self.means

    @property
    def covariance(self) -> Floats:
        """Of `theta`, shape (p, p)."""
        deviations = self.means - self.mean
        covariances = self.covariances + deviations[:, :, None] * deviations[:, None, :]
        return np.asarray(np.tensordot(self.probabilities, covariances, 1))

    def interval(self, probability: float) -> Floats:
        """Ends (p, 2) between which a parameter is with a probability, as much below as above."""
        from scipy.optimize import brentq
        from scipy.special import ndtr, ndtri

        tails = 0.5 * (1.0 - probability), 0.5 * (1.0 + probability)
        intervals = np.empty((len(self.mean), 2))
        for k, ends in enumerate(intervals):
            means, deviations = self.means[:, k], np.sqrt(self.covariances[:, k, k])
            for side, tail in enumerate(tails):
                # a quantile of a mixture is between those of its parts
                parts = means + ndtri(tail) * deviations
                low, high = parts.min() - deviations.max(), parts.max() + deviations.max()
                ends[side] = brentq(
                    lambda x, m=means, s=deviations, q=tail: self.probabilities @ ndtr((x - m) / s) - q, low, high
                )
        return intervals


def averaged_tissue(search: HypothesisSearch) -> AveragedTissue:
    """Tissue averaged over the sets of a search that were weighed."""
    base, weighted_sets, probabilities = search.base, search.weighted_sets, search.probabilities
    tissue, prior = base.nuisances.part("tissue"), base.prior
    means, covariances = [], []
    causes: dict[tuple[str, Kind], float] = {}
    for weighted_set, probability in zip(weighted_sets, probabilities.tolist(), strict=True):
        xi, covariance = weighted_set.marginal.model.coefficients(weighted_set.residual)
        means.append(prior.mean + prior.factor @ xi[tissue])
        covariances.append(prior.factor @ covariance[tissue, tissue] @ prior.factor.T)
        for cause in zip(weighted_set.hypothesis.causes, weighted_set.hypothesis.kinds, strict=True):
            causes[cause] = causes.get(cause, 0.0) + probability
    likely = sorted(causes.items(), key=lambda item: -item[1])
    return AveragedTissue(
        base.states.parameters,
        sum(p for s, p in zip(weighted_sets, probabilities.tolist(), strict=True) if not s.names),
        tuple(LikelyCause(name, kind, probability) for (name, kind), probability in likely),
        probabilities,
        np.array(means),
        np.array(covariances),
    )
