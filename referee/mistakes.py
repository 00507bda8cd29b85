"""Density of what is recorded where any point may be mistaken, as the referee draws it: a mixture over which ones are.

A mistake adds a vector of any direction, whose length is even between two ends, to a point of known noise. It is far
longer than the noise, so that of a mistaken point nothing is known but about where it is: with the rows `S` of all
sound points and the vectors `g` of the mistaken ones Z

    p(w, Z) = N(w_S) prod_(i in Z) q p(x_i) prod_(i not in Z) (1 - q),    p(x) = E_g N(x - g; 0, C_i),

`x_i` what a mistaken point is beside what the sound ones let expect, `C_i` the covariance of that. Errors of such
expectations are taken for independent of each other. The sum over Z is that over each point by itself, about the most
probable Z.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

#: Mistakes are as long as this [m].
LENGTHS = (0.002, 0.004)
#: Nodes of an integral over lengths, and the noise [m] from which their distribution is taken for normal.
_NODES, _BLURRED = 24, 0.8e-3
_ABSCISSAE, _WEIGHTS = np.polynomial.legendre.leggauss(_NODES)
#: Variance of one component of a mistake [m^2].
_VARIANCE = (LENGTHS[1] ** 3 - LENGTHS[0] ** 3) / (9.0 * (LENGTHS[1] - LENGTHS[0]))
_LOG_2_PI = float(np.log(2.0 * np.pi))


def draw(random: np.random.Generator, shape: tuple[int, ...]) -> Floats:
    """Mistakes (*shape, 3) [m]."""
    errors = random.normal(size=(*shape, 3))
    errors *= (random.uniform(*LENGTHS, size=shape) / np.linalg.norm(errors, axis=-1))[..., None]
    return errors


def log_density(x: Floats, covariance: Floats) -> Floats:
    """Log density (k,) [m^-3] of mistakes with normal noise at places (k, 3) [m].

    Noise is taken for alike in all directions, and where it hides that mistakes have a least length, these for normal.

    Parameters
    ----------
    x : (k, 3) array
    covariance : (k, 3, 3) array
        Of the noise [m^2].
    """
    variance = np.trace(covariance, axis1=1, axis2=2)
    square = variance[:, None] / 3.0
    low, high = LENGTHS
    rho = 0.5 * (low + high) + 0.5 * (high - low) * _ABSCISSAE
    r = np.linalg.norm(x, axis=1)[:, None]
    t = np.maximum(2.0 * r * rho / square, 1e-12)
    far = -0.5 * (r - rho) ** 2 / square
    nearest = far.max(axis=1)
    # over directions of a mistake: (1 - exp(-t)) / t, with t = 2 r rho / c^2
    parts = np.exp(far - nearest[:, None]) * (-np.expm1(-t) / t)
    shell = nearest + np.log(parts @ (0.5 * _WEIGHTS)) - 1.5 * (_LOG_2_PI + np.log(square[:, 0]))
    # no axis of a covariance is longer than its trace
    wide = np.flatnonzero(variance > _BLURRED**2)
    wide = wide[np.linalg.eigvalsh(covariance[wide])[:, -1] > _BLURRED**2]
    if len(wide):
        shell[wide] = _normal(x[wide], np.asarray(np.linalg.inv(covariance[wide] + _VARIANCE * np.eye(3))))
    return np.asarray(shell)


def _normal(x: Floats, precision: Floats) -> Floats:
    square = np.einsum("ki,kij,kj->k", x, precision, x)
    return np.asarray(0.5 * np.linalg.slogdet(precision)[1] - 0.5 * square - 1.5 * _LOG_2_PI)


class Mixture:
    """Densities of rows.

    Parameters
    ----------
    precision : (rows, rows) array
        Inverse of the covariance of the rows if all points are sound.
    points : (g, 3) array of int
        Rows of each point that may be mistaken, at each time a point of its own.
    share : float
        Of points that are mistaken.
    """

    def __init__(self, precision: Floats, points: Ints, share: float) -> None:
        self.precision, self.points, self.share = precision, points, share
        self._blocks = precision[points[:, :, None], points[:, None, :]]

    @cached_property
    def _prior(self) -> tuple[float, float]:
        """Log of the probability that a point is mistaken, and of its odds."""
        with np.errstate(divide="ignore"):
            log = float(np.log(self.share))
        return log, log - float(np.log1p(-self.share))

    def log_density(self, w: Floats, start: Bools | None = None) -> tuple[float, Bools]:
        """Log density of rows (rows,), without its constant, and the most probable mistakes (g,).

        `start` (g,): mistakes of rows that are nearly the same.
        """
        weighted = self.precision @ w
        wrong = np.zeros(len(self.points), dtype=bool) if start is None else start.copy()
        for _ in range(4 * len(wrong) + 1):
            log, odds = self._about(weighted, wrong)
            change = np.where(wrong, -odds, odds)
            worst = int(np.argmax(change)) if len(change) else 0
            if not len(change) or change[worst] <= 0.0:
                break
            wrong[worst] = not wrong[worst]
        # of each point by itself, with all others as they are
        sums = float(np.logaddexp(0.0, change).sum())
        return log + sums - 0.5 * float(w @ weighted), wrong

    def log_joint(self, w: Floats, wrong: Bools) -> float:
        """Log density of rows and of which points are mistaken, without the constant of the density."""
        weighted = self.precision @ w
        return self._about(weighted, wrong)[0] - 0.5 * float(w @ weighted)

    def _about(self, weighted: Floats, wrong: Bools) -> tuple[float, Floats]:
        """Log density with some points mistaken, against that of the rows with all sound, and log odds (g,) of each."""
        rows = self.points[wrong].ravel()
        log_share, log_odds = self._prior
        sound = len(self.points) * float(np.log1p(-self.share))
        v, precision = weighted[self.points], self._blocks
        x, covariance = np.empty(v.shape), np.empty(precision.shape)
        log = sound
        if len(rows):
            inner = self.precision[np.ix_(rows, rows)]
            known = np.linalg.inv(inner)
            mean = known @ weighted[rows]
            across = self.precision[:, rows][self.points]
            v = v - across @ mean
            precision = precision - across @ known @ across.transpose(0, 2, 1)
            x[wrong] = mean.reshape(-1, 3)
            covariance[wrong] = np.einsum("iaib->iab", known.reshape(len(rows) // 3, 3, -1, 3))
            precision[wrong] = np.linalg.inv(covariance[wrong])
            # less the density of their rows given the sound ones
            log += 0.5 * (float(mean @ inner @ mean) + len(rows) * _LOG_2_PI - float(np.linalg.slogdet(inner)[1]))
        covariance[~wrong] = np.linalg.inv(precision[~wrong])
        x[~wrong] = np.einsum("kij,kj->ki", covariance[~wrong], v[~wrong])
        mistaken = log_density(x, covariance)
        odds: Floats = log_odds + mistaken - _normal(x, precision)
        if wrong.any():
            log += float((log_share - sound / len(wrong) + mistaken[wrong]).sum())
        return log, odds
