"""The posterior itself, up to a constant: the prior of the generative model, not its normal approximation, times the
likelihood of an equilibrium that was solved, with the nuisances integrated out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.errors import InputError, SolveError
from warpbrain.estimation.forward import ROUGH, State
from warpbrain.estimation.modes import Mode
from warpbrain.estimation.problem import Point
from warpbrain.gp.prior import Prior

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Evaluated:
    """The posterior at a point.

    Attributes
    ----------
    log_density : float
        Minus infinity where it is zero: an unstable law, or no equilibrium.
    state : State or None
    nuisances : (q,) array
        The best ones there.
    """

    log_density: float
    state: State | None
    nuisances: Floats


class Target:
    """Log density of a posterior.

    Parameters
    ----------
    prior : Prior
    modes : sequence of Mode
        States are predicted from the nearest, where solving starts.

    Attributes
    ----------
    unstable, failed : int
        Points whose laws were not stable, and points without an equilibrium.
    """

    def __init__(self, prior: Prior, modes: Sequence[Mode]) -> None:
        self.prior = prior
        self.modes = tuple(modes)
        self.problem = modes[0].estimate.problem
        self.unstable = self.failed = 0

    def nearest(self, theta: Floats) -> Mode:
        """The mode that a point is nearest to, in its own standard deviations."""

        def squares(mode: Mode) -> float:
            away = theta - mode.estimate.theta
            return float(away @ np.linalg.solve(mode.laplace.covariance, away))

        return min(self.modes, key=squares)

    def linearised(self, theta: Floats) -> float:
        """The log density where the state is what derivatives at the nearest estimate make of it."""
        if not self._possible(theta):
            return -np.inf
        mode = self.nearest(theta)
        return self._log_density(mode.predicted(theta), mode.estimate.point)[0]

    def at(self, theta: Floats) -> Evaluated:
        """The log density; an equilibrium is solved for it."""
        mode = self.nearest(theta)
        nothing = Evaluated(-np.inf, None, mode.estimate.point.nuisances)
        if not self._possible(theta):
            self.unstable += 1
            return nothing
        try:
            state = self._solve(theta, mode)
        except SolveError:
            self.failed += 1
            return nothing
        log_density, nuisances = self._log_density(state, mode.estimate.point)
        return Evaluated(log_density, state, nuisances)

    def _solve(self, theta: Floats, mode: Mode) -> State:
        forward = self.problem.forward
        try:
            return forward.solve(theta, mode.predicted(theta).u, ROUGH)
        except SolveError:
            # far from the estimate the prediction may turn elements inside out
            return forward.solve(theta, mode.estimate.point.state.u, ROUGH)

    def _log_density(self, state: State, start: Point) -> tuple[float, Floats]:
        misfit, point = self.problem.without_nuisances(state, start.nuisances, start.known_noise)
        return float(self.prior.log_density(state.theta)) - misfit, point.nuisances

    def _possible(self, theta: Floats) -> bool:
        try:
            self.problem.parameters.require_possible(theta)
        except InputError:
            return False
        return True
