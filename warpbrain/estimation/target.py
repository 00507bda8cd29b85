"""The posterior itself, up to a constant: the prior of the generative model, not its normal approximation, times the
likelihood of an equilibrium that was solved, with the nuisances integrated out.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import InputError, SolveError
from warpbrain.estimation.forward import ROUGH, State
from warpbrain.estimation.modes import Estimate
from warpbrain.estimation.problem import Point
from warpbrain.gp.prior import Prior


class Target:
    """Log density of a posterior.

    Parameters
    ----------
    prior : Prior
    modes : sequence of Estimate
        States are predicted from the nearest, where solving starts.

    Attributes
    ----------
    unstable, failed : int
        Points whose laws were not stable, and points without an equilibrium.
    """

    def __init__(self, prior: Prior, modes: Sequence[Estimate]) -> None:
        self.prior = prior
        self.modes = tuple(modes)
        self.problem = modes[0].problem
        self.unstable = self.failed = 0

    def nearest(self, theta: Floats) -> Estimate:
        """The mode that a point is nearest to, in its own standard deviations."""

        return min(self.modes, key=lambda mode: mode.laplace.posterior.negative_log(theta))

    def linearised(self, theta: Floats) -> float:
        """The log density where the state is what derivatives at the nearest estimate make of it."""
        if not self._possible(theta):
            return -np.inf
        mode = self.nearest(theta)
        return self._log_density(mode.predicted(theta), mode.point)

    def log_density(self, theta: Floats) -> float:
        """Up to a constant, by an equilibrium; minus infinity where laws are unstable or there is no equilibrium."""
        if not self._possible(theta):
            self.unstable += 1
            return -np.inf
        mode = self.nearest(theta)
        starts = mode.predicted(theta).u, mode.point.state.u
        try:
            state = self.problem.forward.solve_from(theta, starts, ROUGH)
        except SolveError:
            self.failed += 1
            return -np.inf
        return self._log_density(state, mode.point)

    def _log_density(self, state: State, start: Point) -> float:
        misfit, _ = self.problem.without_nuisances(state, start.nuisances, start.known_noise)
        return float(self.prior.log_density(state.theta)) - misfit

    def _possible(self, theta: Floats) -> bool:
        try:
            self.problem.parameters.require_possible(theta)
        except InputError:
            return False
        return True
