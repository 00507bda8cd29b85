"""Estimates in every mode of the prior, and how probable each is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.estimation.forward import State
from warpbrain.estimation.laplace import Laplace
from warpbrain.estimation.problem import Linearised, Point, Problem


@dataclass(frozen=True)
class GaussNewtonStep:
    """One line of the history.

    Attributes
    ----------
    iteration : int
        From 1.
    objective : float
        `-ln` of likelihood times prior, before the step.
    decrement : float
        Length of the whole step in standard deviations of the posterior.
    step : float
        Share of it that was taken.
    newton_iterations : int
        Of all equilibria that were tried.
    """

    iteration: int
    objective: float
    decrement: float
    step: float
    newton_iterations: int


@dataclass(frozen=True, eq=False)
class Estimate:
    """The most probable parameters: a top of the posterior.

    Attributes
    ----------
    problem : Problem
    point : Point
    linearised : Linearised
        There.
    converged : bool
    history : tuple of GaussNewtonStep
    """

    problem: Problem
    point: Point
    linearised: Linearised
    converged: bool
    history: tuple[GaussNewtonStep, ...]

    @property
    def theta(self) -> Floats:
        """Estimate of the parameters, shape (p,)."""
        return self.point.state.theta

    @cached_property
    def laplace(self) -> Laplace:
        """The normal distribution that fits the posterior there."""
        return Laplace.of(self.problem, self.theta, self.linearised)

    @cached_property
    def log_evidence(self) -> float:
        """Log probability of what was recorded and of this mode, by Laplace, up to what all modes have in common."""
        prior, point = self.problem.mode, self.point
        misfit, _ = self.problem.without_nuisances(point.state, point.nuisances, point.known_noise)
        log_volume = 0.5 * float(np.linalg.slogdet(self.laplace.covariance)[1])
        log_volume -= float(np.log(np.diag(prior.gaussian.factor)).sum())
        return float(np.log(prior.share)) + log_volume - misfit - prior.gaussian.negative_log(self.theta)

    def predicted(self, theta: Floats) -> State:
        """The state of other parameters, to first order about the estimate."""
        at, derivatives = self.point.state, self.linearised
        step = theta - at.theta
        u = at.u + np.tensordot(step, derivatives.du, axes=1)
        return State(theta, u, at.reactions + np.tensordot(step, derivatives.dR, axes=1), 0)


def probabilities(modes: Sequence[Estimate]) -> Floats:
    """Of each mode after the observation, their sum is 1."""
    from scipy.special import softmax

    return np.asarray(softmax([mode.log_evidence for mode in modes]), dtype=np.float64)
