"""What the noise of the sensors is taken to be: independent, and a part that neighbours have in common."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.worlds.body.sensors import Sensors

Floats = NDArray[np.float64]

#: Standard deviation of the common part relative to the independent one, and the distance [m] over which it is common.
COMMON, REACH = 0.45, 0.018


def noise_factor(sensors: Sensors, sigma: Floats) -> Floats:
    """Lower triangular factor (n, n) of the covariance of the noise, `sigma` (n,) its independent part."""
    from scipy.spatial.distance import cdist

    covariance = np.diag(sigma**2)
    rows = np.flatnonzero(sensors.is_displacement)
    where, directions = sensors.positions[rows], sensors.directions[rows]
    apart = cdist(where, where)
    common = np.exp(-0.5 * (apart / REACH) ** 2) * (directions @ directions.T)
    # what was recorded at another time has another noise
    common *= sensors.times[rows][:, None] == sensors.times[rows][None]
    covariance[np.ix_(rows, rows)] += COMMON**2 * np.outer(sigma[rows], sigma[rows]) * common
    return np.asarray(np.linalg.cholesky(covariance))
