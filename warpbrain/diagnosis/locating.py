"""Where the mismatch is: the score of a force at every place, its significance, and its detectability.

A force patch with columns `B` has the score `T = s^T I^-1 s`, `s = B^T S^-1 r`, `I = B^T S^-1 B`: chi-squared of three
degrees of freedom where nothing is missing. Of a single source without noise the score is largest at its own place,
however deep it lies (the standardisation of Pascual-Marqui's sLORETA, 2002). The largest score of all places is
compared with its distribution in draws of noise and nuisances, which corrects for all tests (Westfall and Young 1993).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Bools, Floats
from warpbrain.inference import GaussianModel
from warpbrain.inference.beliefs import belief
from warpbrain.inference.predict import p_value
from warpbrain.worlds.body.hypotheses import HypothesisSearch
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.unknown import force_patches

#: Size of a patch of the map, in spacings of the scan.
_PATCH = 0.7


@dataclass(frozen=True, eq=False)
class ScoreMap:
    """Scores of places.

    Attributes
    ----------
    sites : (s, 3) array
        [m]
    length : float
        Standard deviation of a patch [m].
    scores : (s,) array
    threshold : float
        Of the largest score, at the level `alpha`.
    global_p, local_p : float
        p-values of the largest score: corrected for all places, and at this place alone.
    detectable : (s,) array
        Smallest force [N] that would be detected there, in the direction of the least sensitivity.
    region : (s,) bool array
        Places that the data do not distinguish from the best.
    """

    sites: Floats
    length: float
    scores: Floats
    threshold: float
    global_p: float
    local_p: float
    detectable: Floats
    region: Bools

    @property
    def best(self) -> int:
        """Number of the place with the largest score."""
        return int(np.argmax(self.scores))

    @property
    def significant(self) -> bool:
        """Whether the largest score is above the threshold."""
        return bool(self.scores[self.best] > self.threshold)

    @property
    def blind_above(self) -> float:
        """Force [N] above which a place counts as blind, if no smaller one would be detected there."""
        return belief("checks.blind") * float(self.detectable.min())

    @property
    def centre(self) -> Floats:
        """Mean (3,) [m] of the places in `region`, weighted by their likelihood."""
        return self._ball[0]

    @property
    def radius(self) -> float:
        """Of a ball [m] about the centre that holds 90 % of that weight, no less than a patch."""
        return max(self._ball[1], self.length)

    @cached_property
    def _ball(self) -> tuple[Floats, float]:
        return ball_of(self.sites, np.exp(0.5 * (self.scores - self.scores.max())) * self.region)


def ball_of(sites: Floats, weights: Floats) -> tuple[Floats, float]:
    """Mean (3,) of weighted places (k, 3) [m], and the radius about it that holds 90 % of the weight."""
    centre = np.asarray(weights @ sites / weights.sum())
    apart = np.linalg.norm(sites - centre, axis=1)
    order = np.argsort(apart)
    at = min(int(np.searchsorted(np.cumsum(weights[order]), 0.9 * weights.sum())), len(order) - 1)
    return centre, float(apart[order][at])


def map_of_search(search: HypothesisSearch, draws: int, random: np.random.Generator, alpha: float = 0.05) -> ScoreMap:
    """The map of what is left of the recordings of a case if nothing acts but what it declares, its tissue fitted.

    `draws`: of recordings if nothing else acts.
    """
    nothing = search.nothing
    model = nothing.marginal.model
    rows = model.draws(draws, random)
    length = _PATCH * search.spacing
    return score_map(search.base.at, model, nothing.residual, rows, length, search.spacing, alpha)


def score_map(
    at: Linearisation,
    model: GaussianModel,
    residual: Floats,
    draws: Floats,
    length: float,
    spacing: float,
    alpha: float = 0.05,
) -> ScoreMap:
    """The map of residuals (n,).

    `model`: of noise and nuisances. `residual` (n,). `draws` (n, b): of rows if no cause acts. `length`, `spacing`: of
    patches and between them [m].
    """
    from scipy.special import chdtrc, chdtri

    sites, answers = force_patches(at, length, spacing)
    columns = model.standardised(answers.reshape(len(answers), -1)).reshape(answers.shape)
    information = np.einsum("nsi,nsj->sij", columns, columns, optimize=True)
    # held places, and those whose effect nuisances explain, have no information and no score
    size = np.trace(information, axis1=1, axis2=2)
    information += 1e-9 * max(float(size.max()), 1e-300) * np.eye(3)

    def scores(rows: Floats) -> Floats:
        s = np.einsum("nsi,nb->sib", columns, model.standardised(rows), optimize=True)
        return np.asarray(np.einsum("sib,sib->sb", s, np.linalg.solve(information, s)))

    observed = scores(residual[:, None])[:, 0]
    largest = scores(draws).max(axis=0)
    threshold = float(np.quantile(largest, 1.0 - alpha))
    # the noncentrality at which one place exceeds the threshold for all with the power that is asked for
    needed = _noncentrality(threshold)
    weakest = np.linalg.eigvalsh(information)[:, 0]
    return ScoreMap(
        sites,
        length,
        observed,
        threshold,
        p_value(observed.max(), largest),
        float(chdtrc(3, observed.max())),
        np.sqrt(needed / np.maximum(weakest, 1e-300)),
        observed.max() - observed <= float(chdtri(3, 0.05)),
    )


def _noncentrality(threshold: float) -> float:
    from scipy.optimize import brentq
    from scipy.special import chndtr

    return float(
        brentq(lambda c: 1.0 - chndtr(threshold, 3, c) - belief("checks.power"), 1e-6, 10.0 * threshold + 100.0)
    )
