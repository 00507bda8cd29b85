"""Smooth random fields, by random Fourier features (Rahimi and Recht 2007)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_FEATURES = 600


def random_field(points: Floats, length: float, seed: int, components: int = 1) -> Floats:
    """Gaussian fields (n, components) of mean 0, variance 1 and covariance ``exp(-r^2 / (2 length^2))``.

    Parameters
    ----------
    points : (n, 3) array
        [m]
    length : float
        [m]
    seed : int
        The same field at whatever points.
    components : int
    """
    random = np.random.default_rng(seed)
    out = np.empty((len(points), components))
    for k in range(components):
        waves = random.normal(size=(3, _FEATURES)) / length
        phases = random.uniform(0.0, 2.0 * np.pi, _FEATURES)
        out[:, k] = np.sqrt(2.0 / _FEATURES) * np.cos(points @ waves + phases).sum(axis=1)
    return out
