"""Likelihood times prior of a case's parameters, at a point and to first order about it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.estimation.forward import Forward, State
from warpbrain.estimation.likelihood import Likelihood, Weighed
from warpbrain.estimation.nuisances import Nuisances
from warpbrain.estimation.observations import Observations, Residuals
from warpbrain.estimation.parameters import Parameters
from warpbrain.estimation.prior_modes import PriorMode

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

#: A row beyond the distance that normal noise passes once in ten thousand is a gross error.
GROSS = 1.0 - 1e-4


@dataclass(frozen=True, eq=False)
class Point:
    """Parameters with everything that is known there.

    Attributes
    ----------
    state : State
    nuisances : (q,) array
    parts : tuple of Residuals
    residuals : tuple of (n, d) arrays
        Of each observation, the rigid motion taken off.
    weighed : tuple of Weighed
    misfit : float
        `-ln` of the likelihood and of the nuisances' density.
    objective : float
        With that of the prior.
    """

    state: State
    nuisances: Floats
    parts: tuple[Residuals, ...]
    residuals: tuple[Floats, ...]
    weighed: tuple[Weighed, ...]
    misfit: float
    objective: float

    @property
    def coordinates(self) -> Floats:
        """Parameters and nuisances, shape (p + q,)."""
        return np.concatenate([self.state.theta, self.nuisances])

    @property
    def gross(self) -> tuple[Bools, ...]:
        """Which rows of each observation are gross errors."""
        from scipy.special import gammaincinv

        pairs = zip(self.residuals, self.weighed, strict=True)
        return tuple(weighed.squares > 2.0 * gammaincinv(0.5 * values.shape[1], GROSS) for values, weighed in pairs)


@dataclass(frozen=True, eq=False)
class Linearised:
    """Derivatives of the objective at a point by `theta` and the nuisances, p + q numbers.

    Attributes
    ----------
    gradient : (p + q,) array
    information : (p + q, p + q) array
        Expected information of the data alone.
    hessian : (p + q, p + q) array
        Of the objective, positive definite; see `warpbrain.estimation.likelihood`.
    du, dR : (p, N, 3) array
        Derivatives of the displacement [m] and of the reactions [N].
    """

    gradient: Floats
    information: Floats
    hessian: Floats
    du: Floats
    dR: Floats


@dataclass(frozen=True, eq=False)
class Problem:
    """What is estimated from what.

    Attributes
    ----------
    forward : Forward
    observations : Observations
    mode : PriorMode
    likelihood : Likelihood
    nuisances : Nuisances
    """

    forward: Forward
    observations: Observations
    mode: PriorMode
    likelihood: Likelihood
    nuisances: Nuisances

    @property
    def parameters(self) -> Parameters:
        """What `theta` means."""
        return self.forward.parameters

    def at(self, state: State, nuisances: Floats, cautious: bool = False) -> Point:
        """The objective at a state; `cautious` as in `Likelihood.weigh`."""
        parts = self.observations.at(*self.nuisances.observed(state, nuisances))
        residuals = tuple(self.nuisances.residuals(part, nuisances) for part in parts)
        weighed = self.likelihood.weigh(self.observations.each, residuals, cautious)
        misfit = sum(one.negative_log for one in weighed) + self.nuisances.negative_log(nuisances)
        objective = misfit + self.mode.gaussian.negative_log(state.theta)
        return Point(state, nuisances, parts, residuals, weighed, misfit, objective)

    def linearise(self, point: Point) -> Linearised:
        """Derivatives at a point; `SolveError` if its equilibrium is unstable."""
        p, q = len(self.parameters), len(self.nuisances)
        found = self.forward.differentiate(point.state)
        gradient, hessian, information = np.zeros(p + q), np.zeros((p + q, p + q)), np.zeros((p + q, p + q))
        for part, residuals, weighed in zip(point.parts, point.residuals, point.weighed, strict=True):
            jacobian = self.nuisances.jacobian(part, point.state.theta, point.nuisances, (found.u, found.reactions))
            gradient += weighed.gradient(residuals, jacobian)
            hessian += weighed.hessian(residuals, jacobian)
            information += weighed.information(jacobian)
        prior = self.mode.gaussian
        gradient[:p] += prior.precision @ (point.state.theta - prior.mean)
        hessian[:p, :p] += prior.precision
        gradient[p:] += self.nuisances.precision @ (point.nuisances - self.nuisances.mean)
        hessian[p:, p:] += self.nuisances.precision
        return Linearised(gradient, information, hessian, found.u, found.reactions)

    def without_nuisances(self, state: State, start: Floats) -> tuple[float, Point]:
        """`-ln` of the likelihood of a state with the nuisances integrated out (Laplace), and their best values.

        No equilibrium is solved: nuisances act on what is observed of the state.
        """
        point = self.at(state, start)
        if len(self.nuisances) == 0:
            return point.misfit, point
        for _ in range(20):
            gradient, hessian = self._by_nuisances(point)
            step = -np.linalg.solve(hessian, gradient)
            decrement = float(-gradient @ step)
            trial = self.at(state, point.nuisances + step)
            while trial.misfit > point.misfit and decrement > 1e-6:
                step, decrement = 0.5 * step, 0.25 * decrement
                trial = self.at(state, point.nuisances + step)
            point = trial if trial.misfit <= point.misfit else point
            if decrement <= 1e-6:
                break
        _, hessian = self._by_nuisances(point)
        return point.misfit + 0.5 * float(np.linalg.slogdet(hessian)[1]), point

    def _by_nuisances(self, point: Point) -> tuple[Floats, Floats]:
        gradient = self.nuisances.precision @ (point.nuisances - self.nuisances.mean)
        hessian = self.nuisances.precision.copy()
        for part, residuals, weighed in zip(point.parts, point.residuals, point.weighed, strict=True):
            jacobian = self.nuisances.jacobian(part, point.state.theta, point.nuisances)
            gradient += weighed.gradient(residuals, jacobian)
            hessian += weighed.hessian(residuals, jacobian)
        return gradient, hessian
