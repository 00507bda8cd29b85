"""How likely residuals are: noise that is normal at heart, with tails for gross errors.

A row of d components has the density of a multivariate Student t of `nu` degrees of freedom (Lange, Little and Taylor
1989, J. Am. Stat. Assoc. 84, 881):

    -ln p = (nu + d)/2 ln(1 + z^2/nu) + d ln sigma + constant,    z^2 = |r|^2/sigma^2

so a gross error takes a whole point with it, not one of its components. `sigma` is the scale of the heart: what a
recording calls its noise. With `nu` infinite the noise is normal, and nothing is a gross error.

The gradient is that of weighted least squares with weights `w = (nu + d)/(nu + z^2)`. Of the residuals of a row the
Hessian is `w/sigma^2 (I - 2/(nu + z^2) r r^T/sigma^2)`. Near the estimate Gauss and Newton's method takes it, less what
of it is negative: gross errors would bend a step the wrong way. Far from it, it takes the weighted squares alone, whose
step never goes too far. The posterior takes the expected information: the weights have the mean 1, and it is a fixed
share of the weighted squares, `(nu + d)/(nu + d + 2) J^T w J / sigma^2`.

A sigma that is not given is the one that makes the residuals likeliest, at every state. Location and scale of a
symmetric distribution are independent in the information matrix, so nothing is lost by that to first order.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

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
        Noise of one component of each row, in its unit.
    squares : (n,) array
        `z^2` of each row.
    weights : (n,) array
        `w`, up to `(nu + d)/nu`; 1 for normal noise.
    negative_log : float
        `-ln p` of the recording.
    bend : (n,) array
        By how much the Hessian of a row is smaller along its residual than across, relative: from 0 to 1; 0 if it is
        the weighted squares that are wanted.
    share : float
        Of the weighted squares that is the expected information.
    """

    sigma: Floats
    squares: Floats
    weights: Floats
    negative_log: float
    bend: Floats
    share: float

    def gradient(self, residuals: Floats, jacobian: Floats) -> Floats:
        """Of `-ln p` by what the Jacobian (n, d, q) of the residuals (n, d) is by."""
        return np.einsum("n,nd,ndq->q", self.weights / self.sigma**2, residuals, jacobian)

    def hessian(self, residuals: Floats, jacobian: Floats) -> Floats:
        """Of `-ln p` to first order in the residuals, less what of it is negative, shape (q, q)."""
        precision = self.weights / self.sigma**2
        squares = np.sum(residuals**2, axis=1)
        along = np.einsum("nd,ndq->nq", residuals, jacobian)
        bent = precision * self.bend / np.where(squares > 0.0, squares, 1.0)
        return np.einsum("n,ndp,ndq->pq", precision, jacobian, jacobian) - np.einsum("n,np,nq->pq", bent, along, along)

    def information(self, jacobian: Floats) -> Floats:
        """The expected one, shape (q, q)."""
        return self.share * np.einsum("n,ndp,ndq->pq", self.weights / self.sigma**2, jacobian, jacobian)


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
        if observation.sigma is None:
            shape = 1.0 / np.sqrt(observation.weights)
            sigma = max(self._scale(lengths / shape**2, d), LEAST_SIGMA) * shape
        elif cautious:
            sigma = max(self._scale(lengths / observation.sigma**2, d), 1.0) * observation.sigma
        else:
            sigma = observation.sigma
        squares = lengths / sigma**2
        log_sigma = d * float(np.sum(np.log(sigma)))
        if math.isinf(self.nu):
            constant = 0.5 * n * d * math.log(2.0 * math.pi)
            negative_log = 0.5 * float(squares.sum()) + log_sigma + constant
            return Weighed(sigma, squares, np.ones(n), negative_log, np.zeros(n), 1.0)
        nu = self.nu
        constant = n * (math.lgamma(0.5 * nu) - math.lgamma(0.5 * (nu + d)) + 0.5 * d * math.log(nu * math.pi))
        logs = 0.5 * (nu + d) * float(np.log1p(squares / nu).sum())
        weights = (nu + d) / (nu + squares)
        bend = np.zeros(n) if cautious else np.minimum(2.0 * squares / (nu + squares), 1.0)
        return Weighed(sigma, squares, weights, logs + log_sigma + constant, bend, (nu + d) / (nu + d + 2.0))

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
