"""A mechanism between the places of its scan: the cell about the best place, scanned more finely.

Each place of a scan stands for a cell about it. So the evidence of the best one becomes the mean over finer places in
its cell, and the best of these is where a fit begins.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference import GaussianModel
from warpbrain.inference.gross_errors import FurtherColumns, PointRows
from warpbrain.inference.noise import outliers
from warpbrain.mesh.quality import principal_axes
from warpbrain.physics.proposal import Patch, Proposal
from warpbrain.threads import in_threads
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.causes import scaled
from warpbrain.worlds.body.dictionary import switch_effects
from warpbrain.worlds.body.effects import Effect, Effects

#: Radii in a cell relative to that of the scan, whose radii are half as large again as each other.
_RADII = (0.8, 1.0, 1.25)


@dataclass(frozen=True, eq=False)
class BestInCell:
    """The best effect of a cell."""

    effect: Effect
    gain: float  # by how much [nats] the mean of the cell is more probable than its middle
    log_share: float  # log of the part of the best place in that mean


def best_in_cell(
    base: Base, effects: Effects, effect: Effect, size: float, spacing: float, without: GaussianModel, residual: Floats
) -> BestInCell:
    """Scan the cell of an effect.

    Each place has gross errors of its own: points that a local effect moves far are sound in the right place alone.

    `effects`: which makes columns at the state that the linear model is about. `effect`: of a proposal that can be
    elsewhere. `size`: of its coefficients, relative to what is usual. `spacing`: between the places of the scan [m].
    `without`: of rows with all else that acts and all points sound. `residual` (n,): less what is expected of all else.
    """

    everywhere = PointRows(without, residual, base.points)

    def log_density(tried: Effect) -> float:
        rows = everywhere.less(tried.mean)
        return rows.with_gross_errors(outliers(), further=FurtherColumns(rows, tried.columns)).log_density

    def logs_of(places: Sequence[Proposal]) -> tuple[list[Effect], Floats]:
        tried = [best, *(scaled(other, size) for other in _effects_of(effects, places))]
        return tried, np.array(in_threads(log_density, tried))

    best = effect
    tried, logs = logs_of(_cell(base, effect, spacing))
    total = float(np.logaddexp.reduce(logs))
    gain, log_share = total - float(np.log(len(logs)) + logs[0]), float(logs.max()) - total
    best = tried[int(np.argmax(logs))]
    if not effect.proposed.on_surface:
        tried, logs = logs_of(_around(base, best.proposed, 0.25 * spacing))
        best = tried[int(np.argmax(logs))]
    return BestInCell(best, gain, log_share)


def _effects_of(effects: Effects, proposals: Sequence[Proposal]) -> list[Effect]:
    """Effects of places, less those where too little would hold the body."""
    if not proposals[0].is_there_or_not:
        return effects.of(proposals)
    return [result for result in switch_effects(effects, proposals) if isinstance(result, Effect)]


def places_about(base: Base, proposed: Proposal, step: float) -> list[Proposal]:
    """Proposals a step [m] from another one along each principal axis, back on the surface if it is of that.

    And at the same place with other radii.
    """
    assert proposed.elsewhere is not None and proposed.centre is not None and proposed.radius is not None
    axes = principal_axes(base.at.system.model.mesh.points)
    centres = [proposed.centre + sign * step * axis for axis in axes for sign in (-1.0, 1.0)]
    if proposed.on_surface:
        middles = _middles(base, proposed.patch)
        nearest = {int(np.argmin(np.sum((middles - centre) ** 2, axis=1))) for centre in centres}
        centres = [middles[number] for number in sorted(nearest)]
    others = [proposed.elsewhere(proposed.centre, factor * proposed.radius) for factor in _RADII if factor != 1.0]
    return [*others, *(proposed.elsewhere(centre, proposed.radius) for centre in centres)]


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
    axes = principal_axes(base.at.system.model.mesh.points)
    offsets = step * np.array(list(itertools.product((0.0, -1.0, 1.0), repeat=3))) @ axes
    return _with_radii(proposed, proposed.centre + offsets)


def _with_radii(proposed: Proposal, centres: Floats) -> list[Proposal]:
    """A proposal at other centres (k, 3) [m] and with other radii, without itself."""
    assert proposed.elsewhere is not None and proposed.radius is not None and proposed.centre is not None
    return [
        proposed.elsewhere(centre, radius * proposed.radius)
        for centre, radius in itertools.product(centres, _RADII)
        if radius != 1.0 or not np.array_equal(centre, proposed.centre)
    ]


def _on_surface(base: Base, centre: Floats, reach: float, patch: Patch | None) -> Floats:
    """A point (3,) [m] and middles of faces about it (k, 3), of faces that are free, or that a patch is a part of.

    They are a quarter of the reach apart or more.
    """
    middles = _middles(base, patch)
    distance = np.linalg.norm(middles - centre, axis=1)
    chosen = [centre]
    for number in np.argsort(distance, kind="stable").tolist():
        if distance[number] > reach:
            break
        if min(np.linalg.norm(np.array(chosen) - middles[number], axis=1)) >= 0.25 * reach:
            chosen.append(middles[number])
    return np.array(chosen)


def _middles(base: Base, patch: Patch | None) -> Floats:
    """Of faces (k, 3) [m] that are free, or that a patch is a part of."""
    mesh = base.at.system.model.mesh
    if patch is None:
        held = np.asarray(base.at.system.model.constrained.reshape(-1, 3).all(axis=1))
        faces = mesh.boundary[~held[mesh.boundary].any(axis=1)]
    else:
        faces = mesh.boundary[patch.held[mesh.boundary].all(axis=1)]
    return np.asarray(mesh.points[faces].mean(axis=1))
