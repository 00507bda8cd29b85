"""The posterior as the normal distribution that fits it at its top (Laplace), and what in it the data have said.

Nuisances are integrated out: of a joint normal distribution that is a block of the covariance. The information of the
data alone, `I`, is that of `theta` less what the nuisances could explain as well (its Schur complement). Beside the
prior covariance `L L^T` its measure is `L^T I L`: along an eigenvector of the eigenvalue `e` the data know `e` times as
much as the prior, and the variance falls to `1/(1 + e)` of what it was.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.estimation.gaussian import Gaussian
from warpbrain.estimation.parameters import Parameters
from warpbrain.estimation.problem import Linearised, Problem


@dataclass(frozen=True, eq=False)
class Laplace:
    """A normal posterior of the parameters.

    Attributes
    ----------
    parameters : Parameters
    theta : (p,) array
        Its mean: the estimate.
    prior : Gaussian
    information : (p, p) array
        Information of the data alone, nuisances integrated out.
    """

    parameters: Parameters
    theta: Floats
    prior: Gaussian
    information: Floats

    @classmethod
    def of(cls, problem: Problem, theta: Floats, linearised: Linearised) -> Laplace:
        """The posterior at the most probable parameters (p,) of a problem, linearised there."""
        p = len(problem.parameters)
        information, joint = linearised.information[:p, :p], linearised.hessian
        if len(problem.nuisances):
            # metres, radians and plain numbers: one size for all
            size = np.sqrt(np.diag(joint[p:, p:]))
            nuisances = joint[p:, p:] / np.outer(size, size)
            mixed = joint[p:, :p] / size[:, None]
            information = information - mixed.T @ np.linalg.solve(nuisances, mixed)
        return cls(problem.parameters, theta, problem.mode.gaussian, information)

    @cached_property
    def covariance(self) -> Floats:
        """Of the parameters, shape (p, p)."""
        # in the prior's own measure, where nothing is too large or too small to be inverted
        values, vectors = self._eigen
        basis = self.prior.factor @ vectors
        return np.asarray(basis / (1.0 + values) @ basis.T)

    @cached_property
    def posterior(self) -> Gaussian:
        """As a distribution."""
        return Gaussian(self.theta, self.covariance)

    @property
    def standard_deviations(self) -> Floats:
        """Of each parameter, shape (p,)."""
        return self.posterior.standard_deviations

    def interval(self, probability: float = 0.95) -> Floats:
        """Central interval of each parameter, shape (p, 2), no farther than its range goes."""
        from scipy.special import ndtri

        away = ndtri(0.5 + 0.5 * probability) * self.standard_deviations
        ends = np.stack([self.theta - away, self.theta + away], axis=1)
        return np.clip(ends, self.parameters.low[:, None], self.parameters.high[:, None])

    def probability_below(self, theta: Floats) -> Floats:
        """Of each parameter, shape (p,), that it is less than that of a vector (p,)."""
        from scipy.special import ndtr

        return np.asarray(ndtr((theta - self.theta) / self.standard_deviations))

    @property
    def gains(self) -> Floats:
        """Information of the data over that of the prior along independent directions, shape (p,), falling."""
        return self._eigen[0]

    @property
    def combinations(self) -> Floats:
        """What the data told of each direction: combinations (p, p) of the parameters, one a row, largest entry 1."""
        return _normalised(np.linalg.inv(self.prior.factor).T @ self._eigen[1])

    @property
    def directions(self) -> Floats:
        """The change of all parameters along each direction, one a row (p, p), largest entry 1.

        Where the gain is small the data cannot tell the estimate from the estimate changed like this.
        """
        return _normalised(self.prior.factor @ self._eigen[1])

    @cached_property
    def _eigen(self) -> tuple[Floats, Floats]:
        L = self.prior.factor
        values, vectors = np.linalg.eigh(L.T @ self.information @ L)
        order = np.argsort(values)[::-1]
        # information is never negative: what is, is rounding
        return np.maximum(values[order], 0.0), vectors[:, order]


def _normalised(columns: Floats) -> Floats:
    """Columns as rows whose largest entry is 1."""
    largest = np.take_along_axis(columns, np.abs(columns).argmax(axis=0)[None], axis=0)
    return np.asarray((columns / largest).T, dtype=np.float64)
