"""Log evidence of draws of one cause or of two, against nothing, in units of all that is not known."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from referee.library import Draws

Floats = NDArray[np.float64]

#: Sizes between the ends of each draw.
_SIZES = 24


def single(w: Floats, draws: Draws) -> Floats:
    """Log evidence (k,) of residuals (k, rows) under one cause: the mean over its draws, sizes and signs."""
    z = w @ draws.directions.T
    parts = (np.arange(_SIZES) + 0.5) / _SIZES
    sizes = draws.low[:, None] * (draws.high / draws.low)[:, None] ** parts
    x = z[:, :, None] * sizes
    both = np.logaddexp(x, -x) - np.log(2.0)
    logs = np.where(draws.both[:, None], both, x) - 0.5 * sizes**2
    found: Floats = logsumexp(logs, axis=(1, 2)) - np.log(logs.shape[1] * _SIZES)
    return found


def pair(w: Floats, first: Draws, second: Draws, least: float) -> Floats:
    """Log evidence (k,) under two causes at once, each of which alone stands out by `least` or more.

    Sizes are integrated by Laplace's method about the best ones within their ends.
    """
    rho = np.clip(first.directions @ second.directions.T, -0.999, 0.999)
    ends = [_ends(draws, least) for draws in (first, second)]
    if any((low >= high).all() for low, high in ends):
        return np.full(len(w), -np.inf)
    (low_a, high_a), (low_b, high_b) = ((low[:, None], high[:, None]) for low, high in ends)
    low_b, high_b = low_b.T, high_b.T
    log_prior = -_spread(low_a, high_a, first.both[:, None]) - _spread(low_b, high_b, second.both[None])
    log_prior = np.where((low_a < high_a) & (low_b < high_b), log_prior, -np.inf)
    volume = np.log(2.0 * np.pi) - 0.5 * np.log1p(-(rho**2))
    each = (_one(z, rho, (low_a, high_a), (low_b, high_b), first, second) for z in _projections(w, first, second))
    used = max(int(np.isfinite(log_prior).sum()), 1)
    return np.array([logsumexp(log + log_prior + volume) - np.log(used) for log in each])


def _projections(w: Floats, first: Draws, second: Draws) -> Iterator[tuple[Floats, Floats]]:
    for row in w:
        yield (first.directions @ row)[:, None], (second.directions @ row)[None]


def _ends(draws: Draws, least: float) -> tuple[Floats, Floats]:
    return np.maximum(draws.low, min(least, float(draws.high.max()) * 0.5)), draws.high


def _spread(low: Floats, high: Floats, both: NDArray[np.bool_]) -> Floats:
    return np.log(np.maximum(np.log(np.maximum(high / low, 1.0 + 1e-9)), 1e-9)) + np.log(2.0) * both


def _one(
    z: tuple[Floats, Floats],
    rho: Floats,
    ends_a: tuple[Floats, Floats],
    ends_b: tuple[Floats, Floats],
    first: Draws,
    second: Draws,
) -> Floats:
    """Log density at the best sizes and of the prior there, (k, l), by alternating between both."""
    za, zb = z
    a = _within((za - rho * zb) / (1.0 - rho**2), ends_a, first.both[:, None])
    for _ in range(3):
        b = _within(zb - rho * a, ends_b, second.both[None])
        a = _within(za - rho * b, ends_a, first.both[:, None])
    return a * za + b * zb - 0.5 * (a**2 + b**2 + 2.0 * rho * a * b) - np.log(np.abs(a * b))


def _within(size: Floats, ends: tuple[Floats, Floats], both: NDArray[np.bool_]) -> Floats:
    sign = np.where(both & (size < 0.0), -1.0, 1.0)
    found: Floats = sign * np.clip(sign * size, *ends)
    return found


def normal(w: Floats, columns: Floats) -> Floats:
    """Log evidence (k,) where amounts of mean 0 and variance 1 of columns (c, rows) act besides, by Woodbury."""
    gram = np.eye(len(columns)) + columns @ columns.T
    b = columns @ w.T
    found: Floats = 0.5 * (b * np.linalg.solve(gram, b)).sum(axis=0) - 0.5 * np.linalg.slogdet(gram)[1]
    return found


def scaled(w: Floats, covariance: Floats) -> Floats:
    """Log evidence (k,) of another covariance (rows, rows) than 1."""
    square = (w.T * np.linalg.solve(covariance, w.T)).sum(axis=0)
    found: Floats = 0.5 * ((w**2).sum(axis=1) - square - np.linalg.slogdet(covariance)[1])
    return found
