"""Which points that were set aside as gross errors are none, once all that may be missing is considered.

A point that no smooth force explains is set aside before anything is looked for; see `gross_errors`. But what acts in
one place moves the point beside it by millimetres and its neighbours by little: the one point that tells most. So each
point that was set aside is asked again, with `e` the probability of a gross error, `q` the wide distribution of one,
and every hypothesis `H` that is looked for,

    odds = (1 - e) sum_H p(H) p(r | H) / (e sum_H p(H) p(r, its noise q | H)),

with half of `p(H)` for nothing missing. A gross error alone is no reason for a mechanism: its neighbours have to agree.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.base import Base
from warpbrain.diagnosis.dictionary import Candidates
from warpbrain.diagnosis.gross_errors import ASIDE
from warpbrain.diagnosis.screening import Screening
from warpbrain.diagnosis.single_points import LARGE, OFTEN

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


def sound_points(base: Base, candidates: Candidates) -> Bools:
    """Rows (n,) of points that were set aside, and are rather no gross errors.

    Parameters
    ----------
    base : Base
    candidates : Candidates
        There.
    """
    sound = np.zeros(len(base.aside), dtype=bool)
    if not base.aside.any():
        return sound
    kappa = np.array([base.explanation.best_kappa(base.whitened)])
    screening = Screening(base.explanation, candidates, base.smooth_forces, kappa)
    while True:
        points = np.unique(base.at.sensors.groups[base.aside & ~sound]).tolist()
        each = [base.at.sensors.groups == point for point in points]
        odds = [_log_odds(screening, base.residual, rows) for rows in each]
        if not odds or max(odds) <= 0.0:
            return sound
        soundest = each[int(np.argmax(odds))]
        sound |= soundest
        screening = screening.with_noise(soundest, 1.0 / ASIDE)


def _log_odds(screening: Screening, residual: Floats, rows: Bools) -> float:
    """Logarithm of the odds that a point, whose rows are set aside in a screening, is no gross error."""
    densities = []
    for times in (1.0, LARGE):
        asked = screening.with_noise(rows, times / ASIDE)
        screen = asked.run(asked.explanation.whitened(residual)[:, None])
        densities.append(float(screen.none[0] + np.logaddexp(0.0, screen.alarm[0])))
    return float(np.log1p(-OFTEN) - np.log(OFTEN)) + densities[0] - densities[1]
