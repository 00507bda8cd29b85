"""What a hypothesis predicts of points that it was not fitted to.

Points are put into blocks before anything is fitted; each block is predicted from all others. Blocks are regions. What
acts in one place only cannot be predicted from everywhere else: for that, points are held out here and there. Only
mechanics predicts: the means of the nuisances and of the mechanism given the rest, no interpolation of residuals.

Whether one hypothesis predicts better than another is asked of the log density of the blocks, not of their root mean
square error: a mechanism that moves a few points by far more than the noise is no less certain for leaving the others
as they are, and an error of many points at the noise floor hides it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.sensors import Sensors, spread_points

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Blocks, and draws of the bootstrap over them.
_BLOCKS, _DRAWS = 24, 2000


def spatial_blocks(sensors: Sensors) -> Ints:
    """Block (n,) of each row: that of the nearest of points that are far from each other; forces are one block."""
    rows = sensors.is_displacement
    found = np.zeros(len(sensors), dtype=np.int64)
    where = sensors.positions[rows]
    if not len(where):
        return found
    order = spread_points(where, 0.0, min(_BLOCKS, len(np.unique(sensors.groups[rows]))))
    found[rows] = np.argmin(np.linalg.norm(where[:, None] - where[order][None], axis=2), axis=1)
    found[~rows] = len(order)
    return found


def scattered_blocks(sensors: Sensors) -> Ints:
    """Block (n,) of each row: points here and there, by their numbers."""
    return sensors.groups % _BLOCKS


@dataclass(frozen=True, eq=False)
class Predicted:
    """Errors of predictions.

    Attributes
    ----------
    errors : (n,) array
        What was recorded less what was predicted from the other blocks [m]; of displacements.
    blocks : (n,) int array
    rows : (n,) int array
        Of the sensors.
    log_densities : (b,) array
        Of what was recorded in each block, given the other blocks; empty where it was not asked for.
    """

    errors: Floats
    blocks: Ints
    rows: Ints
    log_densities: Floats = field(default_factory=lambda: np.zeros(0))

    @property
    def rmse(self) -> float:
        """Root mean square of the rows [m]."""
        return float(np.sqrt(np.mean(self.errors**2)))

    @property
    def log_density(self) -> float:
        """Of all blocks."""
        return float(self.log_densities.sum())

    def improvement(self, over: Predicted, rng: np.random.Generator, sure: float = 0.95) -> tuple[float, float, float]:
        """Part of another's root mean square error that is gone, and its interval (bootstrap over blocks)."""
        names = np.unique(self.blocks)
        own = np.array([np.sum(self.errors[self.blocks == b] ** 2) for b in names])
        other = np.array([np.sum(over.errors[over.blocks == b] ** 2) for b in names])
        chosen = rng.integers(len(names), size=(_DRAWS, len(names)))
        parts = 1.0 - np.sqrt(own[chosen].sum(axis=1) / other[chosen].sum(axis=1))
        low, high = np.quantile(parts, [0.5 - 0.5 * sure, 0.5 + 0.5 * sure])
        return float(1.0 - np.sqrt(own.sum() / other.sum())), float(low), float(high)

    def gain(self, over: Predicted) -> tuple[float, float]:
        """By how much [nats] the blocks are more probable than under another, and its standard error over blocks."""
        each = self.log_densities - over.log_densities
        return float(each.sum()), float(np.sqrt(len(each) * each.var(ddof=1))) if len(each) > 1 else np.inf


class HeldOut:
    """Predicts blocks of whitened-by-sigma rows.

    Parameters
    ----------
    sensors : Sensors
    sigma : (n,) array
        Noise of each row; rows that are set aside have a very large one.
    counted : (n,) bool array
        Rows that errors are counted of.
    blocks : (n,) int array
    """

    def __init__(self, sensors: Sensors, sigma: Floats, counted: NDArray[np.bool_], blocks: Ints) -> None:
        self.blocks = blocks
        self.sigma = sigma
        self._counted = counted & sensors.is_displacement

    def predict(self, residual: Floats, columns: Floats, kappa: float = 1.0) -> Predicted:
        """Blocks under a linear model `residual = columns z + kappa noise`, `z ~ N(0, I)`.

        Parameters
        ----------
        residual : (n,) array
            With all of `z` at zero.
        columns : (n, k) array
        kappa : float
            Factor on the noise.
        """
        from scipy.linalg import cho_factor, cho_solve, solve_triangular

        sigma = kappa * self.sigma
        W = columns / sigma[:, None]
        w = residual / sigma
        whole, right = np.eye(W.shape[1]) + W.T @ W, W.T @ w
        errors = np.zeros(len(residual))
        densities = []
        for block in np.unique(self.blocks):
            own = self.blocks == block
            factor = cho_factor(whole - W[own].T @ W[own], lower=True, check_finite=False)
            z = cho_solve(factor, right - W[own].T @ w[own])
            errors[own] = residual[own] - columns[own] @ z
            counted = own & self._counted
            if counted.any():
                spread = solve_triangular(factor[0], W[counted].T, lower=True, check_finite=False)
                L = np.linalg.cholesky(np.eye(spread.shape[1]) + spread.T @ spread)
                left = np.linalg.solve(L, errors[counted] / sigma[counted])
                log_size = float(np.log(np.diag(L) * sigma[counted] * np.sqrt(2.0 * np.pi)).sum())
                densities.append(-0.5 * float(left @ left) - log_size)
        rows = np.flatnonzero(self._counted)
        return Predicted(errors[rows], self.blocks[rows], rows, np.array(densities))


def placebo(
    held_out: HeldOut,
    residual: Floats,
    columns: Floats,
    flexible: Floats,
    freedom: int,
    tries: int,
    size: float,
    rng: np.random.Generator,
    kappa: float = 1.0,
    count: int = 200,
) -> list[Predicted]:
    """Predictions with patterns that mean nothing in the place of a mechanism.

    Parameters
    ----------
    held_out : HeldOut
    residual, columns : arrays
        Of the hypothesis without the mechanism.
    flexible : (n, f) array
        Modes of smooth forces, of which patterns are made.
    freedom : int
        Parameters of the mechanism.
    tries : int
        Of how many patterns the one that fits best is taken, as a mechanism that is scanned is.
    size : float
        Of a pattern relative to that of `flexible`.
    rng : Generator
    kappa : float
        Factor on the noise.
    count : int
    """
    found = []
    white_columns = columns / held_out.sigma[:, None]
    white = residual / held_out.sigma
    gram = np.eye(columns.shape[1]) + white_columns.T @ white_columns
    for _ in range(count):
        many = size * flexible @ rng.normal(size=(flexible.shape[1], tries * freedom))
        scaled = many / held_out.sigma[:, None]
        left = scaled - white_columns @ np.linalg.solve(gram, white_columns.T @ scaled)
        b, whole = left.T @ white, scaled.T @ left
        gains = []
        for k in range(0, tries * freedom, freedom):
            own = slice(k, k + freedom)
            M = np.eye(freedom) + whole[own, own]
            gains.append(float(b[own] @ np.linalg.solve(M, b[own])) - float(np.linalg.slogdet(M)[1]))
        k = freedom * int(np.argmax(gains))
        found.append(held_out.predict(residual, np.column_stack([columns, many[:, k : k + freedom]]), kappa))
    return found
