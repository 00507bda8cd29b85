"""Standard deviation of what was recorded without a declared one: the likeliest beside any smooth force."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.inference.beliefs import beliefs
from warpbrain.worlds.body.sensors import Sensors

Floats = NDArray[np.float64]

#: Distance from zero [robust standard deviations] beyond which a row says nothing of the noise of most.
_FAR = 3.0


def noise_of(sensors: Sensors, residual: Floats, nuisances: Floats, field: Floats) -> Floats:
    """Standard deviation (n,) of each row.

    Parameters
    ----------
    sensors : Sensors
    residual : (n,) array
    nuisances : (n, k) array
        Columns of one standard deviation.
    field : (n, k) array
        Of a smooth force of 1 m.
    """
    sigma = sensors.sigma.copy()
    undeclared = np.unique(sensors.recordings[np.isnan(sigma)]).tolist()
    if not undeclared:
        return sigma
    lengths = sensors.is_displacement
    size = float(np.sqrt(np.mean(residual[lengths] ** 2))) if lengths.any() else 0.0
    explained = np.column_stack([nuisances, max(size, 1e-9) * field])
    ordinary = _ordinary(residual, explained)
    for number in undeclared:
        rows = sensors.recordings == number
        rows = rows & ordinary if (rows & ordinary).any() else rows
        scale = max(float(np.sqrt(np.mean(residual[rows] ** 2))), 1e-12)
        low, high = beliefs("noise.undeclared").tolist()
        tried = scale * np.geomspace(low, high, 25)
        scores = [_log_density(residual[rows], explained[rows], sigma) for sigma in tried.tolist()]
        sigma[sensors.recordings == number] = tried[int(np.argmax(scores))]
    return sigma


def _ordinary(residual: Floats, explained: Floats) -> NDArray[np.bool_]:
    """Rows that a smooth fit leaves no more of than most: a few gross errors must not make a noise of all."""
    scale = max(float(np.median(np.abs(residual))), 1e-12)
    W = explained / scale
    left = residual - explained @ np.linalg.solve(np.eye(W.shape[1]) + W.T @ W, W.T @ (residual / scale))
    return np.asarray(np.abs(left) <= _FAR * 1.4826 * np.median(np.abs(left)))


def _log_density(residual: Floats, columns: Floats, sigma: float) -> float:
    W, w = columns / sigma, residual / sigma
    values, vectors = np.linalg.eigh(W.T @ W)
    projected = (W @ vectors).T @ w
    values = np.maximum(values, 0.0)
    square = float(w @ w - np.sum(projected**2 / (1.0 + values)))
    return -0.5 * (square + float(np.log1p(values).sum())) - len(residual) * float(np.log(sigma))
