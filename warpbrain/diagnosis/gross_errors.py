"""Recorded points that no smooth force field explains: gross errors, such as landmarks that were mispaired.

A point is compared with what all others say of it, under the nuisances and any smooth force (leave one out, in closed
form). Points that stand out beside each other are no errors but a signal, and are kept.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.evidence import Explanation
from warpbrain.worlds.body.sensors import Sensors, rows_of_points

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

#: Probability below which a point is a gross error, and how often to look again without the ones found.
_UNLIKELY, _ROUNDS = 2e-4, 3
#: Neighbours [m], and how many of them standing out together are a signal.
_NEAR, _TOGETHER = 0.013, 3
#: Factor on the noise of what is set aside: it counts for nothing then.
ASIDE = 1e3


def gross_errors(sensors: Sensors, explanation: Explanation, kappa: float, residual: Floats) -> Bools:
    """Which rows (n,) belong to gross errors.

    Parameters
    ----------
    sensors : Sensors
    explanation : Explanation
        With any smooth force among the nuisances.
    kappa : float
        Factor on the noise.
    residual : (n,) array
        As recorded, not whitened.
    """
    from scipy.special import chdtrc

    aside = np.zeros(len(sensors), dtype=bool)
    points = rows_of_points(sensors)
    for _ in range(_ROUNDS):
        kept = np.flatnonzero(~aside)
        place = np.full(len(sensors), -1)
        place[kept] = np.arange(len(kept))
        left = _of_rows(explanation, kept) if aside.any() else explanation
        weighted = left.inverse_times(residual[kept], kappa)
        found = []
        for rows in points:
            own = place[rows[(place[rows] >= 0).all(axis=1)]]
            # what all others leave of a point, by its own block of the inverse
            blocks = left.inverse_blocks(own, kappa)
            apart = np.linalg.solve(blocks, weighted[own][:, :, None])[:, :, 0]
            squares = np.sum(weighted[own] * apart, axis=1)
            found.extend(kept[own[chdtrc(rows.shape[1], squares) < _UNLIKELY]].ravel().tolist())
        if not found:
            break
        aside[found] = True
    return _without_clusters(sensors, aside)


def _of_rows(explanation: Explanation, rows: NDArray[np.int64]) -> Explanation:
    """The explanation of some rows (k,) alone."""
    factor = explanation.factor[rows]
    return Explanation(np.asarray(np.linalg.cholesky(factor @ factor.T), dtype=np.float64), explanation.nuisances[rows])


def _without_clusters(sensors: Sensors, aside: Bools) -> Bools:
    there = aside & np.isfinite(sensors.positions).all(axis=1)
    out = [np.flatnonzero(sensors.groups == group) for group in np.unique(sensors.groups[there]).tolist()]
    if not out:
        return aside
    where = np.array([sensors.positions[rows[0]] for rows in out])
    near = (np.linalg.norm(where[:, None] - where[None], axis=2) < _NEAR).sum(axis=1)
    kept = aside.copy()
    for rows, count in zip(out, near.tolist(), strict=True):
        if count >= _TOGETHER:
            kept[rows] = False
    return kept
