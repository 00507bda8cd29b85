"""The noise of recordings that declare none: found as by an estimate, given nuisances and a smooth force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.estimation.likelihood import Likelihood
from warpbrain.inference.noise import noise_factor
from warpbrain.recordings.agreement import root_mean_square
from warpbrain.worlds.body.sensors import Sensors


def noise_of(sensors: Sensors, residual: Floats, nuisances: Floats, field: Floats) -> Floats:
    """Standard deviation (n,) of each row.

    `residual` (n,). `nuisances` (n, k): columns of one standard deviation. `field` (n, k): of a smooth force of 1 m.
    """
    undeclared = np.isnan(sensors.sigma)
    if not undeclared.any():
        return sensors.sigma
    lengths = sensors.is_displacement
    size = root_mean_square(residual[lengths]) if lengths.any() else 0.0
    columns = np.column_stack([nuisances, max(size, 1e-9) * field])
    # a smooth fit as rough as the residuals are: what it leaves is where the search begins
    typical = max(float(np.median(np.abs(residual))), 1e-12)
    W = columns / typical
    left = residual - columns @ np.linalg.solve(np.eye(W.shape[1]) + W.T @ W, W.T @ (residual / typical))
    # what the mesh does not resolve is found with each set of causes
    resolved = replace(sensors, over_element=np.zeros_like(sensors.over_element))
    found = Likelihood().noise(resolved, left, residual, columns)
    # a factor on noise of which none is declared is its size
    return found.scale * found.sigma if undeclared.all() else found.sigma


def factor_of_noise(sensors: Sensors, sigma: Floats, unresolved: Floats | None = None) -> Floats:
    """Lower factor (n, n) of the covariance of noise; arguments as of `warpbrain.inference.noise.noise_factor`."""
    rows = sensors
    return noise_factor(rows.positions, rows.directions, rows.times, sigma, rows.radius, unresolved)
