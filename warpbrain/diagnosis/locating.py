"""What is known of a mismatch whatever its name: where it is, and of an unknown force its resultant and its depth.

A force patch with columns `B` has the score `T = s^T I^-1 s`, `s = B^T S^-1 r`, `I = B^T S^-1 B`: chi-squared of three
degrees of freedom where nothing is missing. Of a single source without noise the score is largest at its own place,
however deep it lies (the standardisation of Pascual-Marqui's sLORETA, 2002). The largest score of all places is
compared with its distribution in draws of noise and nuisances, which corrects for all tests (Westfall and Young 1993).

An unknown force is that of independent Gaussian patches all over the body. With `E c` linear functionals of their
coefficients `c ~ N(0, s^2 I)`, `A` the response of the sensors to these and `S` the covariance of noise and nuisances

    mean = s^2 E A^T (S + s^2 A A^T)^-1 r,     covariance = s^2 E E^T - s^4 E A^T (S + s^2 A A^T)^-1 A E^T.

A net force that is not zero is external: growth and stress within the body have none. But of a stress beside what is
held a part acts on nodes that do not move, and the rest looks like a net force. So stress there is part of `S`, as
large as is likely: a net force is told if such a stress does not explain it.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from warpbrain.arrays import Bools, Floats
from warpbrain.inference import GaussianModel
from warpbrain.inference.beliefs import belief, beliefs
from warpbrain.inference.predict import own_axes, p_value
from warpbrain.mesh import nodes_of
from warpbrain.threads import in_threads
from warpbrain.worlds.body.causes import UNKNOWN
from warpbrain.worlds.body.hypotheses import HypothesisSearch
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.sources import Source
from warpbrain.worlds.body.unknown import force_patches, stress_beside_held
from warpbrain.worlds.body.weighted_set import WeightedSet

#: Size of a patch of the map, in spacings of the scan.
_PATCH = 0.7


@dataclass(frozen=True, eq=False)
class ScoreMap:
    """Scores of places."""

    sites: Floats  # (s, 3) [m]
    length: float  # standard deviation of a patch [m]
    scores: Floats  # (s,)
    threshold: float  # of the largest score, at the level `alpha`
    #: p-values of the largest score: corrected for all places, and at this place alone.
    global_p: float
    local_p: float
    #: (s,), smallest force [N] that would be detected there, in the direction of the least sensitivity.
    detectable: Floats
    region: Bools  # (s,), places that the data do not distinguish from the best

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
    length = _PATCH * search.spacing
    return score_map(
        search.base.at, nothing.marginal.model, nothing.residual, draws, random, length, search.spacing, alpha
    )


def score_map(
    at: Linearisation,
    model: GaussianModel,
    residual: Floats,
    draws: int,
    random: np.random.Generator,
    length: float,
    spacing: float,
    alpha: float = 0.05,
) -> ScoreMap:
    """The map of residuals (n,).

    `model`: of noise and nuisances.
    `draws`: of rows if no cause acts, the same in any axes and order of rows (`FieldFactors.drawn`).
    `length`, `spacing`: of patches and between them [m].
    """
    from scipy.optimize import brentq
    from scipy.special import chdtrc, chdtri, chndtr

    sites, answers = force_patches(at, length, spacing)
    columns = model.standardised(answers.reshape(len(answers), -1)).reshape(answers.shape)
    information = np.einsum("nsi,nsj->sij", columns, columns, optimize=True)
    # held places, and those whose effect nuisances explain, have no information and no score
    size = np.trace(information, axis1=1, axis2=2)
    information += 1e-9 * max(float(size.max()), 1e-300) * np.eye(3)

    def scores(white: Floats) -> Floats:
        s = np.einsum("nsi,nb->sib", columns, white, optimize=True)
        return np.asarray(np.einsum("sib,sib->sb", s, np.linalg.solve(information, s)))

    white = model.standardised(residual)
    observed = scores(white[:, None])[:, 0]
    # the sum of the quadratic forms that scores are
    form = np.einsum("nsi,sij,msj->nm", columns, np.linalg.inv(information), columns, optimize=True)
    axes = own_axes(form, white)
    largest = scores(axes @ random.normal(size=(len(axes), draws))).max(axis=0)
    threshold = float(np.quantile(largest, 1.0 - alpha))
    # the noncentrality at which one place exceeds the threshold for all with the power that is asked for
    missed = 1.0 - belief("checks.power")
    needed = brentq(lambda c: chndtr(threshold, 3, c) - missed, 1e-6, 10.0 * threshold + 100.0)
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


@dataclass(frozen=True, eq=False)
class FittedSource:
    """What has no name, as a source in one place that was fitted."""

    centre: Floats  # (3,) [m]
    length: float  # of its Gaussian [m]
    is_stress: bool  # a stress, and no force
    turns: bool  # whether it moves more by what runs around the place than by its net force
    force: Floats  # (3,), net force [N]; zero of a stress
    force_sd: Floats
    #: Root mean square error of points that were not fitted, without it and with it [m].
    without: float
    error: float

    @classmethod
    def of(cls, fitted: WeightedSet, without: float, error: float) -> FittedSource:
        """Of a fitted set with a source; errors of points that were not fitted, without and with it [m]."""
        number = fitted.acting.index(UNKNOWN)
        effect, (z, covariance) = fitted.effects[number], fitted.coefficients[number]
        source = effect.proposed.make(effect.coefficients(z))
        assert isinstance(source, Source)
        is_stress, sd = bool(source.stress), effect.proposed.sd[:3] * np.sqrt(np.diag(covariance)[:3])
        turns = not is_stress and float(np.linalg.norm(z[3:])) > float(np.linalg.norm(z[:3]))
        force_sd = np.zeros(3) if is_stress else sd
        return cls(
            np.array(source.centre), source.length, is_stress, turns, np.array(source.force), force_sd, without, error
        )


@dataclass(frozen=True, eq=False)
class Traits:
    """Of an unknown force."""

    #: (3,), net force [N].
    force: Floats
    force_sd: Floats
    #: (3,), net moment about `centre` [N m].
    moment: Floats
    moment_sd: Floats
    outside: bool  # whether there is a net force: it is exerted from outside the body
    turning: bool  # whether there is a net moment
    hidden: bool  # whether there seems to be a net force, which what holds the body may carry: it cannot be told
    surface_nats: float  # log Bayes factor of a force on the surface alone over one within the body alone
    centre: Floats  # (3,), where it is [m]
    resistance: bool = False  # whether it is more like tissue whose resistance changes in time than a force or a stress
    source: FittedSource | None = None  # where it is all that acts, in one place

    @property
    def size(self) -> tuple[float, float]:
        """Of the net force, and its standard deviation [N]."""
        size = float(np.linalg.norm(self.force))
        along = self.force / size if size > 0.0 else np.full(3, 3**-0.5)
        return size, float(np.linalg.norm(along * self.force_sd))


def traits_of(
    at: Linearisation,
    model: GaussianModel,
    residual: Floats,
    noise: float,
    length: float,
    centre: Floats,
) -> Traits:
    """Traits of a force that residuals (n,) show beside noise and nuisances.

    `model`: of noise and nuisances.
    `noise`: typical noise of displacements [m].
    `length`: of patches [m].
    `centre` (3,): about which moments are taken [m].
    """
    sites, answers = force_patches(at, length)
    # patches on held nodes have no effect
    moving = np.linalg.norm(answers, axis=(0, 2)) > 1e-3 * np.linalg.norm(answers, axis=(0, 2)).max()
    sites, answers = sites[moving], answers[:, moving]
    A = answers.reshape(len(answers), -1)
    rows = at.sensors.is_displacement
    unit = noise / np.sqrt(np.mean(np.sum(A[rows] ** 2, axis=1)))
    functionals = unit * _summed(sites, centre)
    resultant = partial(_Resultant.of, unit * A, functionals, model.covariance, residual)
    plain, with_hiding = resultant(None), resultant(noise * stress_beside_held(at, length))
    force, moment = slice(0, 3), slice(3, 6)
    sd = np.sqrt(np.maximum(np.diag(with_hiding.covariance), 0.0))
    outside = with_hiding.is_significant(force)
    return Traits(
        with_hiding.mean[force],
        sd[force],
        with_hiding.mean[moment],
        sd[moment],
        outside,
        with_hiding.is_significant(moment),
        plain.is_significant(force) and not outside,
        _surface_nats(at, sites, answers, model, plain.size * unit, residual, length),
        centre,
    )


@dataclass(frozen=True, eq=False)
class _Resultant:
    """Posterior of net force and moment."""

    mean: Floats  # (6,)
    covariance: Floats  # (6, 6)
    size: float  # of the patches, relative to those that move as much as the noise: the likeliest

    @classmethod
    def of(
        cls, patches: Floats, functionals: Floats, covariance: Floats, residual: Floats, hiding: Floats | None
    ) -> _Resultant:
        """Of patches (n, k) beside a covariance (n, n), and beside columns (n, m) that hide it, of any size."""
        from scipy.linalg import cho_factor, cho_solve

        sizes = beliefs("unknown.sizes").tolist()
        of_patches, of_hiding = patches @ patches.T, None if hiding is None else hiding @ hiding.T
        # metres and newtons have one size
        units = np.sqrt(np.diag(covariance))

        def factor_of(pair: tuple[float, float]) -> Any:
            total = covariance + pair[0] ** 2 * of_patches + (0.0 if of_hiding is None else pair[1] ** 2 * of_hiding)
            return cho_factor(total / np.outer(units, units))

        def log_density(pair: tuple[float, float]) -> float:
            factor = factor_of(pair)
            square = float(residual / units @ cho_solve(factor, residual / units))
            return -0.5 * square - float(np.log(np.diag(factor[0])).sum())

        pairs = list(itertools.product(sizes, (0.0,) if of_hiding is None else sizes))
        best = pairs[int(np.argmax(in_threads(log_density, pairs)))]
        size, factor = best[0], factor_of(best)
        F = size**2 * functionals @ patches.T / units
        mean = F @ cho_solve(factor, residual / units)
        spread = size**2 * functionals @ functionals.T - F @ cho_solve(factor, F.T)
        return cls(mean, spread, size)

    def is_significant(self, part: slice) -> bool:
        """Whether three of the components are not zero."""
        from scipy.special import chdtri

        square = float(self.mean[part] @ np.linalg.solve(self.covariance[part, part], self.mean[part]))
        return square > float(chdtri(3, 1.0 - belief("checks.sure")))


def _summed(sites: Floats, centre: Floats) -> Floats:
    """Net force and net moment about a centre (6, 3 s) of forces at sites (s, 3)."""
    # the columns of a cross product with the arm
    moments = np.cross((sites - centre)[:, None], np.eye(3))
    return np.concatenate([np.tile(np.eye(3), len(sites)), moments.reshape(-1, 3).T])


def _surface_nats(
    at: Linearisation,
    sites: Floats,
    answers: Floats,
    model: GaussianModel,
    scale: float,
    residual: Floats,
    length: float,
) -> float:
    """Log Bayes factor of a force near the surface alone over a deeper one with the same mean displacement."""
    from scipy.spatial import cKDTree

    mesh = at.system.model.mesh
    skin = mesh.points[nodes_of(mesh.boundary, len(mesh.points))]
    superficial = cKDTree(skin).query(sites)[0] < 0.5 * length
    if superficial.all() or not superficial.any():
        return 0.0
    whole = float(np.sum(answers**2))
    log_densities = []
    for chosen in (superficial, ~superficial):
        part = answers[:, chosen].reshape(len(answers), -1)
        as_large = scale * (whole / float(np.sum(part**2))) ** 0.5
        log_densities.append(float(model.with_columns(as_large * part).log_density(residual)))
    return log_densities[0] - log_densities[1]
