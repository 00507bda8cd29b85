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

from warpbrain.worlds.body.sensors import Sensors, spread_points

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
        """By how much [nats] the blocks are more probable than under another; with the block that gains most, and
        without it.

        What acts in one place is seen by few points, so that its gain lies in few blocks: an error over blocks says
        nothing of it. But where a single block makes all of the gain it may be by chance.
        """
        each = self.log_densities - over.log_densities
        return float(each.sum()), float(each.sum() - each.max(initial=0.0))


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
        return self.predict_each(residual, columns, np.zeros((1, len(residual), 0)), kappa)[0]

    def predict_each(self, residual: Floats, columns: Floats, more: Floats, kappa: float = 1.0) -> list[Predicted]:
        """The same with each of some sets of columns (c, n, f) beside those (n, k) that all of them have.

        What all have is factorised once a block. With `A = I + W^T W` over the other blocks, `p` the more columns there
        and `q = p_b - W_b A^-1 W^T p` what the block has of them beside that, the precision of their coefficients is
        `H = I + p^T p - (W^T p)^T A^-1 W^T p` and the block's covariance grows by `q H^-1 q^T` (Woodbury's identity).
        """
        from scipy.linalg import cho_factor, cho_solve, solve_triangular

        sigma = kappa * self.sigma
        W, P = columns / sigma[:, None], more / sigma[:, None]
        w = residual / sigma
        whole, right = np.eye(W.shape[1]) + W.T @ W, W.T @ w
        WP, PP, Pw = W.T @ P, P.transpose(0, 2, 1) @ P, w @ P
        count, freedom = len(more), more.shape[2]
        errors = np.zeros((count, len(residual)))
        densities = []
        for block in np.unique(self.blocks):
            own = self.blocks == block
            Wb, wb, Pb = W[own], w[own], P[:, own]
            factor = cho_factor(whole - Wb.T @ Wb, lower=True, check_finite=False)
            z = cho_solve(factor, right - Wb.T @ wb)
            others = WP - Wb.T @ Pb
            flat = others.transpose(1, 0, 2).reshape(len(z), count * freedom)
            inner = cho_solve(factor, flat).reshape(len(z), count, freedom).transpose(1, 0, 2)
            H = np.eye(freedom) + PP - Pb.transpose(0, 2, 1) @ Pb - others.transpose(0, 2, 1) @ inner
            toward = Pw - wb @ Pb - z @ others
            left, q = wb - Wb @ z, Pb - Wb @ inner
            size = np.linalg.solve(H, toward[:, :, None])
            errors[:, own] = sigma[own] * (left - (q @ size)[:, :, 0])
            counted = self._counted[own]
            if counted.any():
                spread = solve_triangular(factor[0], Wb[counted].T, lower=True, check_finite=False)
                L = np.linalg.cholesky(np.eye(spread.shape[1]) + spread.T @ spread)
                flat = np.column_stack(
                    [left[counted], q[:, counted].transpose(1, 0, 2).reshape(len(L), count * freedom)]
                )
                white = solve_triangular(L, flat, lower=True, check_finite=False)
                t = white[:, 1:].reshape(len(L), count, freedom).transpose(1, 0, 2)
                e = white[:, :1] - t @ size
                te, wider = t.transpose(0, 2, 1) @ e, H + t.transpose(0, 2, 1) @ t
                quadratic = np.sum(e**2, axis=(1, 2)) - np.sum(te * np.linalg.solve(wider, te), axis=(1, 2))
                log_size = np.log(np.diag(L) * sigma[own][counted] * np.sqrt(2.0 * np.pi)).sum()
                log_size = log_size + 0.5 * (np.linalg.slogdet(wider)[1] - np.linalg.slogdet(H)[1])
                densities.append(-0.5 * quadratic - log_size)
        rows = np.flatnonzero(self._counted)
        log_densities = np.array(densities).reshape(-1, count).T
        return [
            Predicted(own[rows], self.blocks[rows], rows, each) for own, each in zip(errors, log_densities, strict=True)
        ]


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
    W = columns / held_out.sigma[:, None]
    modes = size * flexible / held_out.sigma[:, None]
    left = modes - W @ np.linalg.solve(np.eye(W.shape[1]) + W.T @ W, W.T @ modes)
    # a pattern is a mixture of modes: how well it fits follows from how they do
    toward, among = left.T @ (residual / held_out.sigma), modes.T @ left
    mixtures = rng.normal(size=(count, flexible.shape[1], tries, freedom)).transpose(0, 2, 1, 3)
    b = np.einsum("m,ctmf->ctf", toward, mixtures)
    M = np.eye(freedom) + mixtures.transpose(0, 1, 3, 2) @ among @ mixtures
    gains = np.sum(b * np.linalg.solve(M, b[..., None])[..., 0], axis=2) - np.linalg.slogdet(M)[1]
    best = mixtures[np.arange(count), np.argmax(gains, axis=1)]
    return held_out.predict_each(residual, columns, size * flexible @ best, kappa)
