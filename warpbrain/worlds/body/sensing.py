"""Standard deviation of recordings that declare none: the most likely one given nuisances and a smooth force."""

from __future__ import annotations

import numpy as np

from warpbrain.arrays import Bools, Floats
from warpbrain.inference.beliefs import beliefs
from warpbrain.worlds.body.sensors import Sensors

#: Residual [robust standard deviations] above which a row does not count for the noise.
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
    inliers = _inliers(residual, explained)
    for number in undeclared:
        rows = sensors.recordings == number
        rows = rows & inliers if (rows & inliers).any() else rows
        scale = max(float(np.sqrt(np.mean(residual[rows] ** 2))), 1e-12)
        low, high = beliefs("noise.undeclared").tolist()
        candidates = scale * np.geomspace(low, high, 25)
        scores = [_log_density(residual[rows], explained[rows], sigma) for sigma in candidates.tolist()]
        sigma[sensors.recordings == number] = candidates[int(np.argmax(scores))]
    return sigma


def _inliers(residual: Floats, explained: Floats) -> Bools:
    """Rows without outliers from a smooth fit: a few gross errors must not set the noise of all."""
    scale = max(float(np.median(np.abs(residual))), 1e-12)
    W = explained / scale
    remaining = residual - explained @ np.linalg.solve(np.eye(W.shape[1]) + W.T @ W, W.T @ (residual / scale))
    return np.asarray(np.abs(remaining) <= _FAR * 1.4826 * np.median(np.abs(remaining)))


def _log_density(residual: Floats, columns: Floats, sigma: float) -> float:
    W, w = columns / sigma, residual / sigma
    values, vectors = np.linalg.eigh(W.T @ W)
    projected = (W @ vectors).T @ w
    values = np.maximum(values, 0.0)
    square = float(w @ w - np.sum(projected**2 / (1.0 + values)))
    return -0.5 * (square + float(np.log1p(values).sum())) - len(residual) * float(np.log(sigma))
