"""Evidence of a set of causes of a body, summed over the size of what is not known of the mesh's error.

That part of the error is correlated in space, as what a local cause moves is. A set that explains the recordings leaves
a small one; under a wrong set it takes up what is left. With one size for all sets it would hide causes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference.beliefs import beliefs
from warpbrain.inference.marginal import Marginal, marginal
from warpbrain.worlds.body.base import Base

#: The sum over sizes ends where a term is below this part of the largest.
_NEGLIGIBLE = 1e-2


def evidence_of(base: Base, columns: Floats, residual: Floats, scale: float = 1.0) -> tuple[Floats, Marginal]:
    """Evidence of residuals, and the columns with the most probable size of the mesh's unknown error.

    Parameters
    ----------
    base : Base
    columns : (n, q) array
        Of nuisances and causes.
    residual : (n,) array
        Less what is expected of the causes.
    scale : float
        A factor on the noise near the most probable one.

    Returns
    -------
    columns : (n, q) array
    marginal : Marginal
        With these columns; its log evidence is the mean over all sizes.
    """
    nuisances, fractions = base.nuisances, beliefs("mesh.unknown")
    if not nuisances.families[-1].columns.any():
        # nothing moves, or no displacement was recorded
        return columns, marginal(base.model.of_noise(columns), residual, base.points, scale)
    logs = np.full(len(fractions), -np.inf)
    weighed: dict[int, tuple[Floats, Marginal]] = {}

    def add(number: int) -> None:
        at_fraction = nuisances.at_fraction(columns, float(fractions[number]))
        # gross errors are nearly the same whatever the mesh's error
        known = next((result for _, result in weighed.values()), None)
        near = (scale, None) if known is None else (known.scale, known.inflation)
        result = marginal(base.model.of_noise(at_fraction), residual, base.points, *near)
        weighed[number], logs[number] = (at_fraction, result), result.log_evidence

    first = int(np.argmin(np.abs(np.log(fractions / nuisances.fraction_of(columns)))))
    add(first)
    for step in (-1, 1):
        number = first + step
        while 0 <= number < len(fractions):
            add(number)
            if logs[number] < logs.max() + np.log(_NEGLIGIBLE):
                break
            number += step
    best_columns, best = weighed[int(np.argmax(logs))]
    mean = float(np.logaddexp.reduce(logs) - np.log(len(fractions)))
    return best_columns, replace(best, log_evidence=mean)
