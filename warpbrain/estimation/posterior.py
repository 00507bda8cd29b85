"""What is known of a case's tissue after its recordings: the answer of an estimation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.estimation.finer_mesh import DiscretisationError
from warpbrain.estimation.fit import Estimate, probabilities
from warpbrain.estimation.identifiability import Identifiability, identifiability
from warpbrain.estimation.observations import Observations
from warpbrain.estimation.options import EstimationOptions
from warpbrain.estimation.parameters import Parameter, Parameters
from warpbrain.estimation.prediction import OverallErrors, Prediction, predictions
from warpbrain.estimation.sampling import Chain, Importance
from warpbrain.gp.prior import Prior
from warpbrain.shown import Shown


@dataclass(frozen=True, eq=False)
class Marginal:
    """What is known of one parameter."""

    parameter: Parameter
    estimate: float  # the most probable value
    mean: float
    deviation: float
    interval: tuple[float, float]  # 95 % of the posterior and of the prior lie between, as much below as above
    prior_mean: float
    prior_deviation: float
    prior_interval: tuple[float, float]

    @property
    def shrinkage(self) -> float:
        """By how much of the prior's the standard deviation fell: 0, nothing was learnt; 1, all."""
        return 1.0 - self.deviation / self.prior_deviation


@dataclass(frozen=True, eq=False)
class Posterior(Shown):
    """The answer.

    Attributes
    ----------
    case : Case
    options : EstimationOptions
    prior : Prior
    modes : tuple of Estimate
        The most probable first.
    remarks : tuple of str
        What a user should know of how it was found.
    mesh_errors : tuple of DiscretisationError
        The error of the mesh each time it was computed; the last one counts. Empty if it was left out.
    importance : Importance
        The check of Laplace's approximation.
    doubts : tuple of str
        Why that is not to be believed; empty if it is.
    chain : Chain or None
        What takes its place then.
    solves : mapping of str to int
        Equilibria by what they were for.
    seconds : mapping of str to float
        Wall time by stage.
    """

    case: Case
    options: EstimationOptions
    prior: Prior
    modes: tuple[Estimate, ...]
    remarks: tuple[str, ...]
    mesh_errors: tuple[DiscretisationError, ...]
    importance: Importance
    doubts: tuple[str, ...]
    chain: Chain | None
    solves: Mapping[str, int]
    seconds: Mapping[str, float]

    @property
    def best(self) -> Estimate:
        """The most probable mode."""
        return self.modes[0]

    @property
    def parameters(self) -> Parameters:
        """What `theta` means."""
        return self.best.problem.parameters

    @property
    def method(self) -> str:
        """``"laplace"`` or ``"chain"``: what marginals and correlation are of."""
        return "laplace" if self.chain is None else "chain"

    @property
    def theta(self) -> Floats:
        """The most probable parameters, shape (p,)."""
        return self.best.theta

    @property
    def mode_probabilities(self) -> Floats:
        """Of each mode by Laplace."""
        return probabilities(self.modes)

    @cached_property
    def covariance(self) -> Floats:
        """Of the parameters, shape (p, p)."""
        if self.chain is None:
            return self.best.laplace.covariance
        return np.atleast_2d(np.cov(self.chain.theta, rowvar=False))

    @property
    def correlation(self) -> Floats:
        """Shape (p, p)."""
        deviations = np.sqrt(np.diag(self.covariance))
        return self.covariance / np.outer(deviations, deviations)

    def interval(self, probability: float) -> Floats:
        """Central interval of each parameter, shape (p, 2)."""
        if self.chain is None:
            return self.best.laplace.interval(probability)
        ends = [50.0 - 50.0 * probability, 50.0 + 50.0 * probability]
        return np.asarray(np.percentile(self.chain.theta, ends, axis=0).T)

    @cached_property
    def marginals(self) -> tuple[Marginal, ...]:
        """Each parameter."""
        prior = np.percentile(self.prior.theta, [2.5, 97.5], axis=0).T
        mean = self.theta if self.chain is None else self.chain.theta.mean(axis=0)
        deviations, of_prior = (np.sqrt(np.diag(C)) for C in (self.covariance, self.prior.covariance))
        columns = self.theta, mean, deviations, self.interval(0.95), self.prior.mean, of_prior, prior
        each = zip(self.parameters, *(column.tolist() for column in columns), strict=True)
        return tuple(
            Marginal(parameter, top, middle, sd, (low, high), prior_mean, prior_sd, (least, most))
            for parameter, top, middle, sd, (low, high), prior_mean, prior_sd, (least, most) in each
        )

    @cached_property
    def joint_covariance(self) -> Floats:
        """Of parameters and nuisances by Laplace, shape (p + q, p + q)."""
        information = self.best.linearised.hessian
        # metres, radians and plain numbers: one size for all
        size = np.sqrt(np.diag(information))
        return np.asarray(np.linalg.inv(information / np.outer(size, size)) / np.outer(size, size))

    @property
    def nuisances(self) -> tuple[tuple[str, float, float], ...]:
        """Name, estimate and standard deviation of each."""
        p = len(self.parameters)
        names = self.best.problem.nuisances.names
        values, deviations = self.best.point.nuisances, np.sqrt(np.diag(self.joint_covariance))[p:]
        return tuple(zip(names, values.tolist(), deviations.tolist(), strict=True))

    @cached_property
    def identifiability(self) -> Identifiability:
        """What the recordings tell at all."""
        return identifiability(self.best)

    @cached_property
    def predictions(self) -> tuple[Prediction, ...]:
        """Recordings that were fitted, then those that check; these are looked at here for the first time."""
        problem, about = self.best.problem, (self.case, self.best)
        unseen = Observations.to_check(self.case, problem.forward.moments)
        both = (("fit", problem.observations), ("check", unseen))
        return tuple(each for pair in both for each in predictions(*about, *pair, self.joint_covariance))

    @property
    def overall_errors(self) -> tuple[OverallErrors, ...]:
        """Errors over all rows of points and surfaces, of those that were fitted and of those that check."""
        return OverallErrors.of(self.predictions)
