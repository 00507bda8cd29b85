"""Tissue averaged over what may act on a body: that of each set of causes, weighed by the probability of the set.

With the probability `P(S)` of each set S, and mean `m_S` and covariance `C_S` of the tissue in the linear model with S,

    p(theta) = sum P(S) N(theta; m_S, C_S),  m = sum P(S) m_S,  C = sum P(S) (C_S + (m_S - m) (m_S - m)^T)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.case import Case
from warpbrain.estimation.gaussian import Gaussian
from warpbrain.estimation.parameters import Parameters
from warpbrain.inference.causes import Kind
from warpbrain.threads import one_thread_of_blas
from warpbrain.worlds.body.base import BaseFinder
from warpbrain.worlds.body.dictionary import candidates_at, dictionary_of
from warpbrain.worlds.body.hypotheses import HypothesisSearch
from warpbrain.worlds.body.not_physics import not_physics_at
from warpbrain.worlds.body.observable import require_observable
from warpbrain.worlds.body.states import States
from warpbrain.worlds.listener import Listener

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class LikelyCause:
    """Something that may act, and the probability that it does, whatever else acts."""

    name: str
    kind: Kind
    probability: float


@dataclass(frozen=True, eq=False)
class AveragedTissue:
    """A mixture of normal distributions of `theta`, one for each set of causes.

    Attributes
    ----------
    parameters : Parameters
        What `theta` means.
    nothing : float
        Probability that nothing acts but what the case says.
    causes : tuple of LikelyCause
        The most probable first.
    probabilities : (s,) array
        Of the sets.
    means : (s, p) array
    covariances : (s, p, p) array
    """

    parameters: Parameters
    nothing: float
    causes: tuple[LikelyCause, ...]
    probabilities: Floats
    means: Floats
    covariances: Floats

    @property
    def mean(self) -> Floats:
        """Of `theta`, shape (p,)."""
        return self.probabilities @ self.means

    @property
    def covariance(self) -> Floats:
        """Of `theta`, shape (p, p)."""
        away = self.means - self.mean
        each = self.covariances + away[:, :, None] * away[:, None, :]
        return np.asarray(np.tensordot(self.probabilities, each, 1))

    def interval(self, probability: float) -> Floats:
        """Ends (p, 2) between which a parameter is with a probability, as much below as above."""
        from scipy.optimize import brentq
        from scipy.special import ndtr, ndtri

        tails = 0.5 * (1.0 - probability), 0.5 * (1.0 + probability)
        found = np.empty((len(self.mean), 2))
        for k, ends in enumerate(found):
            means, deviations = self.means[:, k], np.sqrt(self.covariances[:, k, k])
            for side, tail in enumerate(tails):
                # a quantile of a mixture is between those of its parts
                parts = means + ndtri(tail) * deviations
                low, high = parts.min() - deviations.max(), parts.max() + deviations.max()
                ends[side] = brentq(
                    lambda x, m=means, s=deviations, q=tail: self.probabilities @ ndtr((x - m) / s) - q, low, high
                )
        return found


def averaged_tissue(search: HypothesisSearch) -> AveragedTissue:
    """Tissue averaged over the sets of a search that were weighed."""
    base, weighed, probabilities = search.base, search.weighed, search.probabilities
    part, prior = base.nuisances.part("tissue"), base.prior
    means, covariances = [], []
    causes: dict[tuple[str, Kind], float] = {}
    for one, probability in zip(weighed, probabilities.tolist(), strict=True):
        xi, covariance = one.marginal.model.coefficients(one.residual)
        means.append(prior.mean + prior.factor @ xi[part])
        covariances.append(prior.factor @ covariance[part, part] @ prior.factor.T)
        for cause in zip(one.hypothesis.causes, one.hypothesis.kinds, strict=True):
            causes[cause] = causes.get(cause, 0.0) + probability
    likely = sorted(causes.items(), key=lambda item: -item[1])
    return AveragedTissue(
        base.states.parameters,
        sum(p for one, p in zip(weighed, probabilities.tolist(), strict=True) if not one.names),
        tuple(LikelyCause(name, kind, probability) for (name, kind), probability in likely),
        probabilities,
        np.array(means),
        np.array(covariances),
    )


def screened(
    case: Case,
    device: str | None = None,
    listener: Listener | None = None,
    prior: Gaussian | None = None,
    *,
    mesh_error: bool = True,
    mechanisms: Sequence[str] | None = None,
) -> HypothesisSearch:
    """Sets of causes of a case, weighed in the linear model about its base.

    Parameters
    ----------
    case : Case
    device : str, optional
        Warp device.
    listener : Listener, optional
    prior : Gaussian, optional
        Of the tissues' parameters; that of a diagnosis unless given.
    mesh_error : bool
        False: the mesh is taken for exact.
    mechanisms : sequence of str, optional
        Kinds that are looked for; all by default.

    Raises
    ------
    InputError
        If there are too few recordings.
    SolveError
        If the case as declared has no equilibrium.
    """
    require_observable(case)
    listener = listener or Listener()
    with one_thread_of_blas():
        states = States(case, device)
        dictionary = dictionary_of(case, mechanisms, len(states.times))
        spacing = dictionary.situation.spacing
        base = BaseFinder(states, spacing, mesh_error, False, listener, prior).find()
        candidates = candidates_at(dictionary, base.effects, not_physics_at(base.at, base.nuisances))
        search = HypothesisSearch(base, candidates, spacing, listener)
        search.screen()
    return search
