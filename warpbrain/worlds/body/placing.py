"""A mechanism between the places of its scan: the cell about the best place, scanned more finely.

Each place of a scan stands for a cell about it. So the evidence of the best one becomes the mean over finer places in
its cell, and the best of these is where a fit begins.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.inference import GaussianModel
from warpbrain.physics.proposal import Proposal
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.causes import scaled
from warpbrain.worlds.body.effects import Effect

Floats = NDArray[np.float64]

#: Radii in a cell relative to that of the scan, whose radii are half as large again as each other.
_RADII = (0.8, 1.0, 1.25)


@dataclass(frozen=True, eq=False)
class BestInCell:
    """The best effect of a cell, and by how much [nats] the mean of the cell is more probable than its middle."""

    effect: Effect
    gain: float


def best_in_cell(
    base: Base, effect: Effect, size: float, spacing: float, without: GaussianModel, residual: Floats
) -> BestInCell:
    """Scan the cell of an effect.

    Parameters
    ----------
    base : Base
    effect : Effect
        Of a proposal that can be elsewhere.
    size : float
        Of its coefficients, relative to what is usual.
    spacing : float
        Between the places of the scan [m].
    without : GaussianModel
        Of rows with all else that acts, gross errors among the columns.
    residual : (n,) array
        Less what is expected of all else.
    """
    best, gain = effect, 0.0
    for step in (0.5, 0.25):
        around = base.effects.of(_around(base, best, step * spacing))
        tried = [best, *(scaled(other, size) for other in around)]
        logs = np.array([float(without.with_columns(e.columns).log_density(residual - e.mean)) for e in tried])
        if step == 0.5:
            gain = float(np.logaddexp.reduce(logs) - np.log(len(logs)) - logs[0])
        best = tried[int(np.argmax(logs))]
    return BestInCell(best, gain)


def _around(base: Base, effect: Effect, step: float) -> list[Proposal]:
    """Proposals a step from an effect along each axis, and with other radii."""
    proposed = effect.proposed
    assert proposed.elsewhere is not None and proposed.centre is not None and proposed.radius is not None
    offsets = [np.zeros(3), *(sign * step * axis for axis in np.eye(3) for sign in (-1.0, 1.0))]
    proposals = []
    for offset, radius in itertools.product(offsets, _RADII):
        centre = proposed.centre + offset
        if proposed.on_surface:
            centre = _on_surface(base, centre)
        if offset.any() or radius != 1.0:
            proposals.append(proposed.elsewhere(centre, radius * proposed.radius))
    return proposals


def _on_surface(base: Base, centre: Floats) -> Floats:
    """The nearest middle of a face that is free."""
    mesh = base.at.system.model.mesh
    held = np.asarray(base.at.system.model.constrained.reshape(-1, 3).all(axis=1))
    faces = mesh.boundary[~held[mesh.boundary].any(axis=1)]
    middles = mesh.points[faces].mean(axis=1)
    return np.asarray(middles[np.argmin(np.sum((middles - centre) ** 2, axis=1))])
