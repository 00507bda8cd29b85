"""Estimates in every mode of the prior, and how probable each mode is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.estimation.forward import State
from warpbrain.estimation.gauss_newton import Estimate
from warpbrain.estimation.laplace import Laplace


@dataclass(frozen=True, eq=False)
class Mode:
    """A top of the posterior.

    Attributes
    ----------
    estimate : Estimate
    """

    estimate: Estimate

    @cached_property
    def laplace(self) -> Laplace:
        """The normal distribution that fits the posterior there."""
        return Laplace.of(self.estimate)

    @cached_property
    def log_evidence(self) -> float:
        """Log probability of what was recorded and of this mode, by Laplace, up to what all modes have in common."""
        prior = self.estimate.problem.mode
        point = self.estimate.point
        misfit, _ = self.estimate.problem.without_nuisances(point.state, point.nuisances, point.known_noise)
        log_volume = 0.5 * float(np.linalg.slogdet(self.laplace.covariance)[1])
        log_volume -= float(np.log(np.diag(prior.gaussian.factor)).sum())
        return float(np.log(prior.share)) + log_volume - misfit - prior.gaussian.negative_log(self.estimate.theta)

    def predicted(self, theta: Floats) -> State:
        """The state of other parameters, to first order about the estimate."""
        at, derivatives = self.estimate.point.state, self.estimate.linearised
        step = theta - at.theta
        u = at.u + np.tensordot(step, derivatives.du, axes=1)
        return State(theta, u, at.reactions + np.tensordot(step, derivatives.dR, axes=1), 0)


def probabilities(modes: Sequence[Mode]) -> Floats:
    """Of each mode after the observation, their sum is 1."""
    from scipy.special import softmax

    return np.asarray(softmax([mode.log_evidence for mode in modes]), dtype=np.float64)
