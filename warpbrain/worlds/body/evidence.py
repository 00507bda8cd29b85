"""Evidence of a set of causes of a body, summed over the sizes of what is not known of the mesh's error.

One part of that error is correlated in space, as what a local cause moves is; another is what the mesh does not resolve
(`warpbrain.estimation.observations`). The first is relative to the displacement under the set, which is that of its
causes where these move more than all else. A set that explains the recordings leaves small ones; under a wrong set they
take up what is left. With one size for all sets they would hide causes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference.beliefs import beliefs
from warpbrain.inference.marginal import Marginal, RowsAtScales, Summed, marginal_of
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.nuisances import UNKNOWN_MESH

#: The sum over sizes ends where a term is below this part of the largest.
_NEGLIGIBLE = 1e-2


def evidence_of(base: Base, columns: Floats, residual: Floats, scale: float = 1.0) -> tuple[Floats, Marginal]:
    """Evidence of residuals, and the columns with the most probable size of the smooth part.

    `columns` (n, q): of nuisances and causes. `residual` (n,): less what is expected of the causes. `scale`: a factor
    on the noise near the most probable one. Returns the columns (n, q), and the marginal with these columns and the
    most probable noise; its log evidence is the mean over all sizes.
    """
    nuisances, fractions = base.nuisances, beliefs("mesh.unknown")
    part = nuisances.part(UNKNOWN_MESH)
    # of nothing that moves, or where no displacement was recorded, there is one size
    moving = nuisances.families[UNKNOWN_MESH].any()
    fractions = fractions if moving else np.ones(1)
    others = np.delete(columns, np.r_[part], axis=1) if moving else columns
    models, relative = [noise.of_noise(others) for noise in base.noises], None
    inflation: list[Floats | None] = [None] * len(models)
    if moving:
        as_given = RowsAtScales(models[0], residual, base.points, columns[:, part]).with_gross_errors(scale)
        inflation[0] = as_given.inflation
        moved = _displacement(base, residual - others @ (others.T @ as_given.weighted))
        relative = moved[:, None] * nuisances.relative

    @cache
    def rows(noise: int) -> RowsAtScales:
        return RowsAtScales(models[noise], residual, base.points, relative)

    summed: dict[tuple[int, int], Summed] = {}

    def log_evidence(fraction: int, noise: int) -> float:
        if (fraction, noise) not in summed:
            # gross errors are nearly the same whatever the smooth part; what is not resolved may look like some
            known = next((result for (_, other), result in summed.items() if other == noise), None)
            near = (scale, inflation[noise]) if known is None else (known.scale, known.inflation)
            summed[fraction, noise] = rows(noise).summed(float(fractions[fraction]), *near)
        return summed[fraction, noise].log_evidence

    first = int(np.argmin(np.abs(np.log(fractions / nuisances.fraction))))
    by_fraction = _around(lambda number: log_evidence(number, 0), first, len(fractions))
    best = int(np.argmax(by_fraction))
    by_noise = _around(lambda number: log_evidence(best, number), 0, len(base.noises))
    noise = int(np.argmax(by_noise))
    if noise > 0:
        by_fraction = _around(lambda number: log_evidence(number, noise), best, len(fractions))
        best = int(np.argmax(by_fraction))
    # as if the evidence were a product of what depends on one size, and on the other
    if relative is not None:
        columns = nuisances.with_family(UNKNOWN_MESH, columns, fractions[best] * relative)
    marginal = marginal_of(base.noises[noise].of_noise(columns), base.points, summed[best, noise])
    means = [float(np.logaddexp.reduce(logs) - np.log(len(logs)) - logs.max()) for logs in (by_fraction, by_noise)]
    return columns, replace(marginal, log_evidence=marginal.log_evidence + sum(means))


def _displacement(base: Base, left: Floats) -> Floats:
    """Of the rows (n,) [m], all that was recorded of a point, where some is left (n,): no less than at the base."""
    sensors = base.at.sensors
    explained = sensors.residual + sensors.computed - left
    moved = np.sqrt(np.bincount(sensors.groups, explained**2))[sensors.groups]
    return np.where(sensors.is_displacement, np.maximum(moved, base.nuisances.displacement), 0.0)


def _around(log_evidence: Callable[[int], float], first: int, count: int) -> Floats:
    """Log evidence (count,) by the number of a size, as far from the first one as it is not negligible."""
    logs = np.full(count, -np.inf)
    logs[first] = log_evidence(first)
    for step in (-1, 1):
        number = first + step
        while 0 <= number < count:
            logs[number] = log_evidence(number)
            if logs[number] < logs.max() + np.log(_NEGLIGIBLE):
                break
            number += step
    return logs
