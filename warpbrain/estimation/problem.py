"""Likelihood times prior of a case's parameters, at a point and to first order about it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.estimation.forward import Forward, State
from warpbrain.estimation.gaussian import Gaussian
from warpbrain.estimation.likelihood import IndependentNoise, Likelihood, Noise, Rows
from warpbrain.estimation.nuisances import Nuisances
from warpbrain.estimation.observations import Observations, Residuals
from warpbrain.estimation.parameters import Parameters
from warpbrain.estimation.prior_modes import PriorMode


@dataclass(frozen=True, eq=False)
class Point:
    """Parameters with everything that is known there.

    Attributes
    ----------
    state : State
    nuisances : (q,) array
    parts : tuple of Residuals
        With a rigid motion of what was recorded taken off.
    residual : (n,) array
        All of them, one after the other.
    noise : Noise or IndependentNoise
    misfit : float
        `-ln` of the likelihood and of the nuisances' density.
    objective : float
        With that of the prior.
    """

    state: State
    nuisances: Floats
    parts: tuple[Residuals, ...]
    residual: Floats
    noise: Noise | IndependentNoise
    misfit: float
    objective: float

    @property
    def known_noise(self) -> Noise:
        """The noise of an estimate, where it is always known."""
        assert isinstance(self.noise, Noise)
        return self.noise

    @property
    def coordinates(self) -> Floats:
        """Parameters and nuisances, shape (p + q,)."""
        return np.concatenate([self.state.theta, self.nuisances])


@dataclass(frozen=True, eq=False)
class Linearised:
    """Derivatives of the objective at a point by `theta` and the nuisances, p + q numbers.

    Attributes
    ----------
    jacobian : (n, p + q) array
        Of the residuals.
    gradient : (p + q,) array
    information : (p + q, p + q) array
        Of the data alone.
    hessian : (p + q, p + q) array
        Of the objective, to first order in the residuals: positive definite.
    du, dR : (p, N, 3) array
        Derivatives of the displacement [m] and of the reactions [N].
    """

    jacobian: Floats
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

    @cached_property
    def prior(self) -> Gaussian:
        """Of parameters and nuisances together."""
        from scipy.linalg import block_diag

        both = self.mode.gaussian, self.nuisances.prior
        return Gaussian(np.concatenate([one.mean for one in both]), block_diag(*(one.covariance for one in both)))

    def at(self, state: State, nuisances: Floats, noise: Noise | IndependentNoise | None = None) -> Point:
        """The objective at a state; noise that is as large as the residuals are, unless it is known."""
        motion = self.nuisances.motion(nuisances)
        parts = self.observations.at(*self.nuisances.observed(state, nuisances), motion=motion)
        residual = np.concatenate([part.values.ravel() for part in parts])
        known = IndependentNoise.as_large_as(Rows.of(self.observations, parts), residual) if noise is None else noise
        misfit = known.negative_log(residual) + self.nuisances.prior.negative_log(nuisances)
        objective = misfit + self.mode.gaussian.negative_log(state.theta)
        return Point(state, nuisances, parts, residual, known, misfit, objective)

    def linearise(self, point: Point, derivatives: tuple[Floats, Floats] | None = None) -> Linearised:
        """Derivatives at a point.

        Parameters
        ----------
        point : Point
        derivatives : pair of (p, N, 3) arrays, optional
            Of displacement and reactions there, if they are known.

        Raises
        ------
        SolveError
            If its equilibrium is unstable.
        """
        if derivatives is None:
            found = self.forward.differentiate(point.state)
            derivatives = found.u, found.reactions
        jacobian = self._jacobian(point, derivatives)
        gradient, information = _weighted(point, jacobian)
        gradient += self.prior.gradient(point.coordinates)
        return Linearised(jacobian, gradient, information, information + self.prior.precision, *derivatives)

    def with_likely_noise(self, point: Point, linearised: Linearised) -> Point:
        """The point with the most probable noise, everything that is estimated integrated out about it."""
        columns = linearised.jacobian @ self.prior.factor
        expected = point.residual + linearised.jacobian @ (self.prior.mean - point.coordinates)
        rows = Rows.of(self.observations, point.parts)
        return self.at(point.state, point.nuisances, self.likelihood.noise(rows, point.residual, expected, columns))

    def without_nuisances(self, state: State, start: Floats, noise: Noise) -> tuple[float, Point]:
        """`-ln` of the likelihood of a state with the nuisances integrated out (Laplace), and their best values.

        No equilibrium is solved: nuisances act on what is observed of the state.
        """
        point = self.at(state, start, noise)
        if len(self.nuisances) == 0:
            return point.misfit, point
        for _ in range(20):
            gradient, hessian = self._by_nuisances(point)
            step = -np.linalg.solve(hessian, gradient)
            decrement = float(-gradient @ step)
            trial = self.at(state, point.nuisances + step, noise)
            while trial.misfit > point.misfit and decrement > 1e-6:
                step, decrement = 0.5 * step, 0.25 * decrement
                trial = self.at(state, point.nuisances + step, noise)
            point = trial if trial.misfit <= point.misfit else point
            if decrement <= 1e-6:
                break
        _, hessian = self._by_nuisances(point)
        return point.misfit + 0.5 * float(np.linalg.slogdet(hessian)[1]), point

    def _by_nuisances(self, point: Point) -> tuple[Floats, Floats]:
        gradient, hessian = _weighted(point, self._jacobian(point, None))
        gradient += self.nuisances.prior.gradient(point.nuisances)
        return gradient, hessian + self.nuisances.prior.precision

    def _jacobian(self, point: Point, derivatives: tuple[Floats, Floats] | None) -> Floats:
        """Derivatives (n, k) of the residuals, as `Nuisances.jacobian`."""
        blocks = [
            self.nuisances.jacobian(part, point.state.theta, point.nuisances, derivatives) for part in point.parts
        ]
        return np.concatenate([block.reshape(-1, block.shape[2]) for block in blocks])


def _weighted(point: Point, jacobian: Floats) -> tuple[Floats, Floats]:
    """Gradient (k,) of `-ln p` and its Hessian (k, k) to first order in the residuals."""
    both = point.noise.standardised(np.column_stack([jacobian, point.residual]))
    J, r = both[:, :-1], both[:, -1]
    return J.T @ r, J.T @ J
