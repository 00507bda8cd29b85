"""Residuals whitened by a noise whose size may have to be found first, gross errors set aside."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.evidence import Explanation
from warpbrain.inference.noise import noise_factor
from warpbrain.worlds.body.sensors import Sensors

Floats = NDArray[np.float64]

#: Sizes of an undeclared noise that are tried, as parts of the root mean square of its residuals.
_PARTS = np.geomspace(0.01, 1.2, 25)
#: Distance from zero [robust standard deviations] beyond which a row is out of the ordinary.
_FAR = 3.0


def known_sigma(
    sensors: Sensors, residual: Floats, nuisances: Floats, flexible: Floats, aside: NDArray[np.bool_]
) -> Floats:
    """Standard deviation (n,) of each row: declared, or the likeliest under any smooth force.

    Parameters
    ----------
    sensors : Sensors
    residual : (n,) array
    nuisances, flexible : (n, k) arrays
        Columns of one standard deviation; `flexible` of 1 m.
    aside : (n,) bool array
        Rows that say nothing of the noise.
    """
    sigma = sensors.sigma.copy()
    size = float(np.sqrt(np.mean(residual[sensors.is_displacement] ** 2))) if sensors.is_displacement.any() else 0.0
    explained = np.column_stack([nuisances, max(size, 1e-9) * flexible])
    for number in _undeclared(sensors):
        own = sensors.recordings == number
        counted = own & ~aside
        if not aside.any():
            counted = own & _ordinary(residual, explained)
        scale = float(np.sqrt(np.mean(residual[counted] ** 2)))
        tried = max(scale, 1e-12) * _PARTS
        scores = [_score(counted, part, residual, explained) for part in tried]
        sigma[own] = tried[int(np.argmax(scores))]
    return sigma


def _undeclared(sensors: Sensors) -> Sequence[int]:
    return np.unique(sensors.recordings[np.isnan(sensors.sigma)]).tolist()


def _ordinary(residual: Floats, explained: Floats) -> NDArray[np.bool_]:
    """Rows that a smooth fit leaves no more of than most: a few gross errors must not make a noise of all."""
    scale = max(float(np.median(np.abs(residual))), 1e-12)
    W = explained / scale
    left = residual - explained @ np.linalg.solve(np.eye(W.shape[1]) + W.T @ W, W.T @ (residual / scale))
    return np.asarray(np.abs(left) <= _FAR * 1.4826 * np.median(np.abs(left)))


def _score(own: NDArray[np.bool_], sigma: float, residual: Floats, explained: Floats) -> float:
    W, w = explained[own] / sigma, residual[own] / sigma
    values, vectors = np.linalg.eigh(W.T @ W)
    projected = (W @ vectors).T @ w
    values = np.maximum(values, 0.0)
    square = float(w @ w - np.sum(projected**2 / (1.0 + values)))
    return -0.5 * (square + float(np.log1p(values).sum())) - int(own.sum()) * float(np.log(sigma))


def explanation_of(sensors: Sensors, sigma: Floats, nuisances: Floats) -> Explanation:
    """Noise and nuisances."""
    return Explanation(noise_factor(sensors.positions, sensors.directions, sensors.times, sigma), nuisances)
