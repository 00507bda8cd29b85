"""How likely residuals are: noise that is normal at heart, with tails for gross errors.

A row of d components has the density of a multivariate Student t of `nu` degrees of freedom (Lange, Little and Taylor
1989, J. Am. Stat. Assoc. 84, 881):

    -ln p = (nu + d)/2 ln(1 + z^2/nu) + d ln s + constant,    z^2 = |r|^2/s^2

so a gross error takes a whole point with it, not one of its components. `sigma`, what a recording calls its noise, is
the standard deviation of one component where there are no gross errors. The scale `s` is the one that is likeliest for
normal noise of that standard deviation, `s = c sigma` with `c` from 0.83 for one component to 0.87 for three at `nu` 4
(consistency at the normal distribution; Huber and Ronchetti 2009, Robust Statistics, chapter 5). The density's own
standard deviation, tails included, is `sqrt(nu/(nu - 2)) s`. With `nu` infinite the noise is normal, nothing is a gross
error, and `s` is `sigma`.

The gradient is that of weighted least squares with weights `w = (nu + d)/(nu + z^2)`. Of the residuals of a row the
Hessian is `w/s^2 (I - 2/(nu + z^2) r r^T/s^2)`. Near the estimate Gauss and Newton's method takes it, less what
of it is negative: gross errors would bend a step the wrong way. Far from it, it takes the weighted squares alone, whose
step never goes too far. The posterior takes the information that the estimate has where noise is normal: `A^2/B`, with
`A` the mean Hessian and `B` the mean square of the gradient (Godambe 1960; White 1982). The weights have the mean 1
there, and it is a fixed share of the weighted squares `J^T w J / s^2`.

A sigma that is not given is the one that makes the residuals likeliest, at every state. Location and scale of a
symmetric distribution are independent in the information matrix, so nothing is lost by that to first order.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from warpbrain.errors import InputError
from warpbrain.estimation.observations import Observation

Floats = NDArray[np.float64]

#: An estimated sigma is no smaller [m]: below this it is rounding of the computation.
LEAST_SIGMA = 1e-9


@dataclass(frozen=True, eq=False)
class Weighed:
    """Residuals of one recording, weighed.

    Attributes
    ----------
    sigma : (n,) array
        Standard deviation of one component of each row where there are no gross errors, in its unit.
    scale : (n,) array
        `s` of each row.
    squares : (n,) array
        `|r|^2 / sigma^2` of each row.
    weights : (n,) array
        `w`, up to `(nu + d)/nu`; 1 for normal noise.
    negative_log : float
        `-ln p` of the recording.
    bend : (n,) array
        By how much the Hessian of a row is smaller along its residual than across, relative: from 0 to 1; 0 if it is
        the weighted squares that are wanted.
    share : float
        Of the weighted squares that is the information.
    """

    sigma: Floats
    scale: Floats
    squares: Floats
    weights: Floats
    negative_log: float
    bend: Floats
    share: float

    def gradient(self, residuals: Floats, jacobian: Floats) -> Floats:
        """Of `-ln p` by what the Jacobian (n, d, q) of the residuals (n, d) is by."""
        return np.einsum("n,nd,ndq->q", self.weights / self.scale**2, residuals, jacobian)

    def hessian(self, residuals: Floats, jacobian: Floats) -> Floats:
        """Of `-ln p` to first order in the residuals, less what of it is negative, shape (q, q)."""
        precision = self.weights / self.scale**2
        squares = np.sum(residuals**2, axis=1)
        along = np.einsum("nd,ndq->nq", residuals, jacobian)
        bent = precision * self.bend / np.where(squares > 0.0, squares, 1.0)
        return np.einsum("n,ndp,ndq->pq", precision, jacobian, jacobian) - np.einsum("n,np,nq->pq", bent, along, along)

    def information(self, jacobian: Floats) -> Floats:
        """What the estimate has where noise is normal, shape (q, q)."""
        return self.share * np.einsum("n,ndp,ndq->pq", self.weights / self.scale**2, jacobian, jacobian)


@dataclass(frozen=True)
class Likelihood:
    """Noise of the recordings.

    Parameters
    ----------
    nu : float
        Degrees of freedom; infinite for normal noise.

    Raises
    ------
    InputError
        If `nu` is not positive.
    """

    nu: float = 4.0

    def __post_init__(self) -> None:
        if not self.nu > 0.0:
            raise InputError(f"nu = {self.nu:g}: expected a positive number of degrees of freedom, or infinity")

    def weigh(
        self, observations: Sequence[Observation], residuals: Sequence[Floats], cautious: bool = False
    ) -> tuple[Weighed, ...]:
        """Weigh the residuals (n, d) of each recording.

        Parameters
        ----------
        observations : sequence of Observation
        residuals : sequence of (n, d) arrays
        cautious : bool
            Far from the estimate, where most is not noise yet: take a sigma that is given for the least one, and the
            weighted squares for the Hessian.
        """
        pairs = zip(observations, residuals, strict=True)
        return tuple(self._weigh(observation, values, cautious) for observation, values in pairs)

    def _weigh(self, observation: Observation, residuals: Floats, cautious: bool) -> Weighed:
        n, d = residuals.shape
        lengths = np.sum(residuals**2, axis=1)
        c, share = at_normal_noise(self.nu, d)
        if observation.sigma is None:
            shape = 1.0 / np.sqrt(observation.weights)
            sigma = max(self._scale(lengths / shape**2, d) / c, LEAST_SIGMA) * shape
        elif cautious:
            sigma = max(self._scale(lengths / observation.sigma**2, d) / c, 1.0) * observation.sigma
        else:
            sigma = observation.sigma
        scale = c * sigma
        squares = lengths / sigma**2
        z2 = lengths / scale**2
        log_scale = d * float(np.sum(np.log(scale)))
        if math.isinf(self.nu):
            constant = 0.5 * n * d * math.log(2.0 * math.pi)
            negative_log = 0.5 * float(z2.sum()) + log_scale + constant
            return Weighed(sigma, scale, squares, np.ones(n), negative_log, np.zeros(n), share)
        nu = self.nu
        constant = n * (math.lgamma(0.5 * nu) - math.lgamma(0.5 * (nu + d)) + 0.5 * d * math.log(nu * math.pi))
        logs = 0.5 * (nu + d) * float(np.log1p(z2 / nu).sum())
        weights = (nu + d) / (nu + z2)
        bend = np.zeros(n) if cautious else np.minimum(2.0 * z2 / (nu + z2), 1.0)
        return Weighed(sigma, scale, squares, weights, logs + log_scale + constant, bend, share)

    def _scale(self, squares: Floats, d: int) -> float:
        """The scale that makes rows of squared lengths (n,) likeliest; zero if more than half of them are zero."""
        if math.isinf(self.nu):
            return math.sqrt(float(squares.mean()) / d)
        from scipy.optimize import brentq

        nu, n = self.nu, len(squares)
        top = float(squares.max())
        # too many rows without any residual: no positive scale is likeliest
        if top == 0.0 or (nu + d) * np.count_nonzero(squares) <= n * d:
            return 0.0

        # derivative of -ln p by ln sigma, which rises with sigma
        def slope(log_square: float) -> float:
            ratio = squares * math.exp(-log_square)
            return n * d - float(np.sum((nu + d) * ratio / (nu + ratio)))

        # w is largest, (nu + d)/nu, for small residuals: no root lies above
        high = math.log((nu + d) * float(squares.sum()) / (n * d * nu)) + 1e-9
        low = high - 4.0
        while slope(low) > 0.0:
            low -= 4.0
        return math.exp(0.5 * float(brentq(slope, low, high, xtol=1e-14, rtol=1e-14)))


@cache
def at_normal_noise(nu: float, d: int) -> tuple[float, float]:
    """How a Student t of `nu` degrees of freedom takes standard normal rows of d components.

    Returns
    -------
    scale : float
        The likeliest one: its mean derivative is zero, `E[w z^2] = d`.
    share : float
        Information `A^2/B` about one component of the location, over what the weighted squares have.

    Examples
    --------
    >>> [round(value, 3) for value in at_normal_noise(4.0, 3)]
    [0.869, 0.669]
    """
    if math.isinf(nu):
        return 1.0, 1.0
    from scipy.integrate import quad
    from scipy.optimize import brentq
    from scipy.stats import chi2

    def mean(value: Callable[[float], float]) -> float:
        return float(quad(lambda q: value(q) * chi2.pdf(q, d), 0.0, np.inf, epsabs=1e-12)[0])

    def weight(z2: float) -> float:
        return (nu + d) / (nu + z2)

    def excess(square: float) -> float:
        return mean(lambda q: weight(q / square) * q / square) - d

    # heavier tails than the noise has: the scale is less than its standard deviation
    square = float(brentq(excess, 1e-9, 1.0, xtol=1e-14))
    # of the squared length a component has 1/d in the mean over directions
    A = mean(lambda q: weight(q / square) * (1.0 - 2.0 * q / square / d / (nu + q / square)))
    B = mean(lambda q: weight(q / square) ** 2 * q / square / d)
    return math.sqrt(square), A**2 / B
