"""Places of causes in the linear model, finer than those of a scan.

Each place of a scan stands for a cell about it. So the evidence of the best one becomes the mean over finer places in
its cell, and the best of these is where a fit begins.
"""

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference import GaussianModel
from warpbrain.inference.gross_errors import log_densities_of
from warpbrain.mesh.quality import principal_axes
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.proposal import Patch, Proposal
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.dictionary import BETWEEN, switch_effects
from warpbrain.worlds.body.effects import Effect, Effects
from warpbrain.worlds.body.evidence import evidence_of
from warpbrain.worlds.body.places import RADII, middles_of_faces
from warpbrain.worlds.body.weighted_set import WeightedSet


def best_in_cell(
    base: Base, effects: Effects, effect: Effect, spacing: float, without: GaussianModel, residual: Floats
) -> tuple[Effect, float]:
    """The best effect of the cell of another one, and by how much [nats] the mean of the cell exceeds its middle.

    Each place has gross errors of its own: points that a local effect moves far are sound in the right place alone.

    `effects`: which makes columns at the state that the linear model is about.
    `effect`: of a proposal that can be elsewhere.
    `spacing`: between the places of the scan [m].
    `without`: of rows with all else that acts and all points sound.
    `residual` (n,): less what is expected of all else.
    """

    def logs_of(places: Sequence[Proposal]) -> tuple[list[Effect], Floats]:
        tried = [best, *(other.of_size(effect) for other in _effects_of(effects, places))]
        return tried, log_densities_of(without, residual, base.points, [(each.mean, each.columns) for each in tried])

    best = effect
    tried, logs = logs_of(_cell(base, effect, spacing))
    # the middle comes first
    gain = float(np.logaddexp.reduce(logs) - np.log(len(logs)) - logs[0])
    best = tried[int(np.argmax(logs))]
    if not effect.proposed.on_surface:
        tried, logs = logs_of(_around(base, best.proposed, 0.25 * spacing))
        best = tried[int(np.argmax(logs))]
    return best, gain


def _effects_of(effects: Effects, proposals: Sequence[Proposal]) -> list[Effect]:
    """Effects of places, less those where too little would hold the body."""
    if not proposals[0].is_there_or_not:
        return effects.of(proposals)
    return [result for result in switch_effects(effects, proposals) if isinstance(result, Effect)]


def _cell(base: Base, effect: Effect, spacing: float) -> list[Proposal]:
    """Proposals throughout the cell of an effect: on the surface all of it, in the depth a step to each side."""
    proposed = effect.proposed
    assert proposed.centre is not None
    if not proposed.on_surface:
        return _around(base, proposed, 0.5 * spacing)
    return _with_radii(proposed, _on_surface(base, proposed.centre, 0.5 * spacing, proposed.patch))


def _around(base: Base, proposed: Proposal, step: float) -> list[Proposal]:
    """Proposals a step from another one along each principal axis of the body, corners of that cube among them."""
    assert proposed.centre is not None
    steps = step * np.array(list(itertools.product((0.0, -1.0, 1.0), repeat=3)))
    return _with_radii(proposed, proposed.centre + steps @ principal_axes(base.at.system.model.mesh.points))


def _with_radii(proposed: Proposal, centres: Floats) -> list[Proposal]:
    """A proposal at other centres (k, 3) [m] and with other radii, without itself."""
    assert proposed.elsewhere is not None and proposed.radius is not None and proposed.centre is not None
    return [
        proposed.elsewhere(centre, radius * proposed.radius)
        for centre, radius in itertools.product(centres, RADII)
        if radius != 1.0 or not np.array_equal(centre, proposed.centre)
    ]


def _on_surface(base: Base, centre: Floats, reach: float, patch: Patch | None) -> Floats:
    """A point (3,) [m] and middles of faces about it (k, 3), of faces that are free, or that a patch is a part of.

    They are a quarter of the reach apart or more.
    """
    middles = middles_of_faces(base.at.system.model, patch)
    distance = np.linalg.norm(middles - centre, axis=1)
    chosen = [centre]
    for number in np.argsort(distance, kind="stable").tolist():
        if distance[number] > reach:
            break
        if min(np.linalg.norm(np.array(chosen) - middles[number], axis=1)) >= 0.25 * reach:
            chosen.append(middles[number])
    return np.array(chosen)


def with_refined_places(
    base: Base, candidate: WeightedSet, spacing: float, source: Effects, placed: int = 0
) -> WeightedSet:
    """A set with its mechanisms at the best places within their cells of a scan.

    `spacing`: between the places of the scan [m].
    `source`: which makes columns at the state that the set is linear about.
    `placed`: effects, the first ones, whose places stay: those of the fit that the set is linear about.
    """
    effects = list(candidate.effects)
    placed = len(effects) if candidate.refined else placed
    for number, (effect, part) in enumerate(zip(candidate.effects, candidate.slices, strict=True)):
        if number < placed or effect.proposed.elsewhere is None or effect.is_solved:
            continue
        others = np.delete(candidate.columns, np.r_[part], axis=1)
        without = GaussianModel(candidate.marginal.model.noise_factor, others, candidate.marginal.scale)
        residual = candidate.residual + effect.mean
        apart, about = spacing, source
        if effect.proposed.is_there_or_not:
            # a release: centres are as far apart as those of a scan's patches
            apart, about = BETWEEN * base.at.sensors.radius, source.beside(_acting_beside(candidate, number, placed))
        best, gain = best_in_cell(base, about, effect, apart, without, residual)
        columns = candidate.columns.copy()
        columns[:, part] = best.columns
        residual = residual - best.mean
        columns, refined = evidence_of(base, columns, residual, candidate.marginal.sizes, candidate.marginal.scale)
        effects[number] = best
        candidate = replace(
            candidate,
            effects=tuple(effects),
            residual=residual,
            columns=columns,
            marginal=refined,
        ).with_gain_of_cell(gain)
    return replace(candidate, refined=True)


def _acting_beside(candidate: WeightedSet, number: int, placed: int) -> list[Mechanism]:
    """Mechanisms of a set, without those of one effect and of the first ones, which act where it was linearised."""
    acting = list(zip(candidate.effects, candidate.coefficients, strict=True))
    return [
        mechanism
        for other, (effect, (mean, _)) in enumerate(acting)
        if other >= placed and other != number
        for mechanism in effect.constant_mechanisms(mean)
    ]
