"""The noise of recorded rows: independent, partly shared by neighbours, of an uncertain scale, with gross errors.

    e ~ N(0, kappa^2 R),
    R_ij = sigma_i sigma_j (delta_ij + s^2 exp(-|x_i - x_j|^2 / (2 l^2)) d_i . d_j) + m_i . m_j delta(x_i, x_j)

for rows i, j that were recorded at one time, at the places `x` in the directions `d`, with errors `m` of what the mesh
does not resolve (`warpbrain.estimation.within_element`); rows without a direction, such as forces, are independent. `s`
is `noise.shared` of `priors.toml`, and `l` is `noise.reach` of the radius of the body. The logarithm of `kappa` is a
Student t. Of a few points the noise is many times larger, see `gross_errors`.
"""

import math
from dataclasses import dataclass

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference.beliefs import belief, beliefs


def noise_covariance(
    positions: Floats, directions: Floats, times: Floats, sigma: Floats, radius: float, unresolved: Floats | None = None
) -> Floats:
    """Covariance `R` (n, n) of the noise of rows at a scale of 1.

    `positions` (n, 3): where [m]; not read of rows without a direction.
    `directions` (n, 3): unit vectors along which a displacement was recorded; zero of all else.
    `times` (n,): when [s]; infinite of the end.
    `sigma` (n,): standard deviation of the independent part, in the unit of the row.
    `radius`: of the sphere of the body's volume [m].
    `unresolved` (n, 3): error of a row if its place is off by one standard deviation along each axis, in the unit of
    the row; a place is off alike for all rows of a point.
    """
    from scipy.spatial.distance import cdist

    covariance = np.diag(np.asarray(sigma, dtype=np.float64) ** 2)
    rows = np.flatnonzero(directions.any(axis=1))
    places, axes = positions[rows], directions[rows]
    distances = cdist(places, places)
    shared = np.exp(-0.5 * (distances / (belief("noise.reach") * radius)) ** 2) * (axes @ axes.T)
    shared *= belief("noise.shared") ** 2 * np.outer(sigma[rows], sigma[rows])
    if unresolved is not None and unresolved.any():
        shared += np.where(distances == 0.0, unresolved[rows] @ unresolved[rows].T, 0.0)
    # noise at different times is independent
    covariance[np.ix_(rows, rows)] += shared * (times[rows][:, None] == times[rows][None])
    return covariance


def noise_factor(covariance: Floats, sigma: Floats) -> Floats:
    """Lower triangular factor (n, n) of a covariance of rows whose independent noise is `sigma` (n,)."""
    # rows in metres and in newtons: scaled to a unit diagonal before they are factorised
    return np.asarray(sigma[:, None] * np.linalg.cholesky(covariance / np.outer(sigma, sigma)))


@dataclass(frozen=True)
class Outliers:
    """Prior of gross errors."""

    probability: float  # that a point is one
    inflation: float  # factor on the standard deviation of its noise
    #: Further factors, all equally probable: with a single one a point that is much farther off still has influence.
    further: tuple[float, ...] = ()

    @property
    def inflations(self) -> Floats:
        """Of a sound point, which is 1, and of a gross error, shape (1 + k,)."""
        return np.array([1.0, self.inflation, *self.further])

    @property
    def log_probabilities(self) -> Floats:
        """Of each of them, shape (1 + k,)."""
        count = 1 + len(self.further)
        return np.log(np.array([1.0 - self.probability, *[self.probability / count] * count]))


def outliers() -> Outliers:
    """What is believed of gross errors."""
    return Outliers(
        belief("noise.gross_share"), belief("noise.gross_times"), tuple(beliefs("noise.gross_far").tolist())
    )


def log_scale_density(scales: Floats) -> Floats:
    """Log density (...) of `ln kappa` at factors `kappa` (...) on the noise."""
    nu, width = belief("noise.scale_tail"), belief("noise.scale_width")
    constant = math.lgamma(0.5 * (nu + 1.0)) - math.lgamma(0.5 * nu) - 0.5 * math.log(nu * math.pi) - math.log(width)
    return np.asarray(constant - 0.5 * (nu + 1.0) * np.log1p((np.log(scales) / width) ** 2 / nu))


def scales() -> tuple[Floats, Floats]:
    """Factors on the noise that are summed over, and the log of the prior probability of each, (k,) and (k,)."""
    values = beliefs("noise.scales")
    return values, log_shares(values, log_scale_density(values))


def log_shares(values: Floats, log_density: Floats) -> Floats:
    """Log of the prior probability (k,) of each of increasing values (k,), by the log density (k,) of their logarithm.

    Each stands for the interval of the logarithm that is nearest to it.
    """
    from scipy.special import log_softmax

    return np.asarray(log_softmax(log_density + np.log(np.gradient(np.log(values)))))
