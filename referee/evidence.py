"""Log evidence of draws of one cause or of two, against nothing, in units of all that is not known.

Some points may be mistaken: rows and draws are then without them, and what each draw leaves at them has the density of
a mistake. Where it acts as it most probably does is told, too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from referee.library import Draws
from referee.lost import Lost

Floats = NDArray[np.float64]

#: Sizes between the ends of each draw, and by how much less probable ones are left out where points are mistaken.
_SIZES, _NEGLIGIBLE = 24, 25.0


@dataclass(frozen=True, eq=False)
class Evidence:
    """Of one cause or two.

    Attributes
    ----------
    log : float
        Against nothing and no mistakes beside.
    members : list of (int, float)
        Most probable draw of each cause, by number, and its size with its sign in units of what it would stand out by
        if no point were mistaken.
    """

    log: float
    members: list[tuple[int, float]]


def single(w: Floats, draws: Draws, lost: Lost) -> Evidence:
    """Evidence of rows (rows,) under one cause: the mean over its draws, sizes and signs."""
    seen, moved = lost.of(draws)
    at = lost.at(w[None])[0]
    parts = (np.arange(_SIZES) + 0.5) / _SIZES
    sizes = seen.low[:, None] * (seen.high / seen.low)[:, None] ** parts
    sizes = np.stack([sizes, -sizes], axis=-1)
    logs = (seen.directions @ lost.left(w[None])[0])[:, None, None] * sizes - 0.5 * sizes**2
    logs += lost.log_density(at - sizes[..., None, None] * moved[:, None, None])
    # of a cause that has one sign the other has no weight
    shares = np.where(seen.both[:, None, None], 0.5, np.array([1.0, 0.0]))
    log = float(logsumexp(logs, b=np.broadcast_to(shares, logs.shape))) - np.log(len(logs) * _SIZES)
    best = np.unravel_index(np.where(shares > 0.0, logs, -np.inf).argmax(), logs.shape)
    return Evidence(log, [_member(int(best[0]), float(sizes[best]), draws, seen)])


def _member(number: int, size: float, draws: Draws, seen: Draws) -> tuple[int, float]:
    return number, size * float(draws.high[number] / seen.high[number])


def pair(w: Floats, first: Draws, second: Draws, lost: Lost) -> Evidence:
    """Evidence of rows (rows,) under two causes at once.

    Sizes are integrated by Laplace's method about the best ones within their ends.
    """
    (one, moved_one), (other, moved_other) = lost.of(first), lost.of(second)
    if (one.low >= one.high).all() or (other.low >= other.high).all():
        return Evidence(-np.inf, [])
    rho = np.clip(one.directions @ other.directions.T, -0.999, 0.999)
    low_a, high_a, low_b, high_b = one.low[:, None], one.high[:, None], other.low[None], other.high[None]
    log_prior = -_spread(low_a, high_a, one.both[:, None]) - _spread(low_b, high_b, other.both[None])
    log_prior = np.where((low_a < high_a) & (low_b < high_b), log_prior, -np.inf)
    left = lost.left(w[None])[0]
    z = (one.directions @ left)[:, None], (other.directions @ left)[None]
    log, a, b = _at_best(z, rho, (low_a, high_a), (low_b, high_b), one, other)
    log = log + log_prior + np.log(2.0 * np.pi) - 0.5 * np.log1p(-(rho**2))
    k, j = np.nonzero(log > log.max() - _NEGLIGIBLE)
    shift = a[k, j][:, None, None] * moved_one[k] + b[k, j][:, None, None] * moved_other[j]
    chosen = log[k, j] + lost.log_density(lost.at(w[None])[0] - shift)
    used = max(int(np.isfinite(log_prior).sum()), 1)
    best = int(np.argmax(chosen))
    ends = (k[best], a[k[best], j[best]], first, one), (j[best], b[k[best], j[best]], second, other)
    members = [_member(int(number), float(size), draws, seen) for number, size, draws, seen in ends]
    return Evidence(float(logsumexp(chosen)) - np.log(used), members)


def _spread(low: Floats, high: Floats, both: NDArray[np.bool_]) -> Floats:
    return np.log(np.maximum(np.log(np.maximum(high / low, 1.0 + 1e-9)), 1e-9)) + np.log(2.0) * both


def _at_best(
    z: tuple[Floats, Floats],
    rho: Floats,
    ends_a: tuple[Floats, Floats],
    ends_b: tuple[Floats, Floats],
    first: Draws,
    second: Draws,
) -> tuple[Floats, Floats, Floats]:
    """Log density at the best sizes and of the prior there, and both sizes, (k, l), by alternating between these."""
    za, zb = z
    a = _within((za - rho * zb) / (1.0 - rho**2), ends_a, first.both[:, None])
    for _ in range(3):
        b = _within(zb - rho * a, ends_b, second.both[None])
        a = _within(za - rho * b, ends_a, first.both[:, None])
    return a * za + b * zb - 0.5 * (a**2 + b**2 + 2.0 * rho * a * b) - np.log(np.abs(a * b)), a, b


def _within(size: Floats, ends: tuple[Floats, Floats], both: NDArray[np.bool_]) -> Floats:
    sign = np.where(both & (size < 0.0), -1.0, 1.0)
    return np.asarray(sign * np.clip(sign * size, *ends))
