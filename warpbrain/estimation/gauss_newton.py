"""The most probable parameters: damped Gauss-Newton on likelihood and prior, solving equilibrium from the last state.

Each iteration differentiates the equilibrium (`warpbrain.simulation.sensitivity`), takes the step of weighted least
squares with what the last one taught of the curvature, and starts the next equilibrium where the derivatives say it
will be. A step is halved until the objective falls. Parameters at an end of their range stay there while the objective
pushes them out.

Far from the estimate most of a residual is no noise yet. So the noise is first taken to be as large as the residuals
say; then noise and estimate are found in turn, see `likelihood`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import InputError, SolveError
from warpbrain.estimation.forward import State
from warpbrain.estimation.likelihood import Noise
from warpbrain.estimation.modes import Estimate, GaussNewtonStep
from warpbrain.estimation.problem import Linearised, Point, Problem

#: How often a first state is tried at moduli larger by a factor of e.
_STIFFER = 4
#: There is no estimate if fewer rows than this share are something else.
_FEWEST_EXPLAINED = 0.1
#: Tolerance while noise is not known yet, and how often it is found again.
_ROUGHLY, _ROUNDS = 0.1, 8
#: Iterations at most with each noise, and the change of every parameter below which there is no other.
_ITERATIONS, _LEAST_STEP = 30, 1e-7


class GaussNewton:
    """Looks for the most probable parameters of a problem.

    Parameters
    ----------
    problem : Problem
    tolerance : float
        Converged when the next step is shorter than this in standard deviations of the posterior.
    on_step : callable, optional
        Called with each `GaussNewtonStep`.
    """

    def __init__(
        self,
        problem: Problem,
        tolerance: float = 1e-3,
        on_step: Callable[[GaussNewtonStep], None] | None = None,
    ) -> None:
        self.problem = problem
        self.tolerance = tolerance
        self._on_step = on_step
        self._history: list[GaussNewtonStep] = []

    def solve(self, start: State | None = None, nuisances: Floats | None = None) -> Estimate:
        """Go from a start to the estimate.

        Parameters
        ----------
        start : State, optional
            The state in the middle of the prior by default, and then the first stage is that of large residuals.
        nuisances : (q,) array, optional
            Their middle by default.

        Raises
        ------
        InputError
            If the laws of the middle of the prior are not stable.
        SolveError
            If there is no equilibrium to start from.
        """
        problem = self.problem
        values = problem.nuisances.prior.mean if nuisances is None else nuisances
        self._history = []
        if start is None:
            point, linearised = self._first(values)
            point, linearised, _ = self._descend(point, linearised, _ROUGHLY)
        else:
            point = problem.at(start, values)
            linearised = problem.linearise(point)
        for number in range(_ROUNDS):
            last = point.noise
            point = problem.with_likely_noise(point, linearised)
            linearised = problem.linearise(point, (linearised.du, linearised.dR))
            settled = isinstance(last, Noise) and point.known_noise.is_near(last)
            tolerance = self.tolerance if number else max(_ROUGHLY, self.tolerance)
            point, linearised, converged = self._descend(point, linearised, tolerance)
            if settled:
                break
        return Estimate(problem, point, linearised, converged, tuple(self._history))

    def _first(self, values: Floats) -> tuple[Point, Linearised]:
        """The middle of the prior; something stiffer if there is no stable equilibrium."""
        problem, mode = self.problem, self.problem.mode
        theta = np.clip(mode.gaussian.mean, mode.low, mode.high)
        problem.parameters.require_possible(theta)
        stiffer = problem.parameters.is_modulus.astype(np.float64)
        why = ""
        for times in range(_STIFFER + 1):
            try:
                point = problem.at(problem.forward.solve(theta + times * stiffer), values)
                return point, problem.linearise(point)
            except SolveError as error:
                why = str(error)
        raise SolveError(f"in the middle of the prior, and up to {math.exp(_STIFFER):.0f} times stiffer: {why}")

    def _descend(self, point: Point, linearised: Linearised, tolerance: float) -> tuple[Point, Linearised, bool]:
        """Downhill with one noise to where a step is no longer worth it."""
        hessian = linearised.hessian
        for iteration in itertools.count():
            step = self._step(point, linearised, hessian)
            decrement = float(np.sqrt(step @ hessian @ step))
            if decrement <= tolerance or np.abs(step).max() <= _LEAST_STEP:
                return point, linearised, True
            if iteration == _ITERATIONS:
                return point, linearised, False
            reached, share, newton = self._search(point, linearised, step)
            record = GaussNewtonStep(len(self._history) + 1, point.objective, decrement, share, newton)
            self._history.append(record)
            if self._on_step is not None:
                self._on_step(record)
            if reached is None:
                # what is left is rounding of the objective, or nothing better lies this way
                return point, linearised, decrement <= 10.0 * tolerance
            taken = reached[0].coordinates - point.coordinates
            hessian = _secant(reached[1].hessian, taken, reached[1].gradient - linearised.gradient)
            point, linearised = reached
        raise AssertionError("unreachable")

    def _step(self, point: Point, linearised: Linearised, whole: Floats) -> Floats:
        """The step of Gauss-Newton with a Hessian among the parameters that are free to move."""
        theta, gradient, mode = point.state.theta, linearised.gradient, self.problem.mode
        moving = np.ones(len(gradient), dtype=bool)
        p = len(theta)
        moving[:p] = ~((theta <= mode.low) & (gradient[:p] > 0.0))
        moving[:p] &= ~((theta >= mode.high) & (gradient[:p] < 0.0))
        step = np.zeros(len(gradient))
        hessian = whole[np.ix_(moving, moving)]
        # shifts are metres, turns radians and moduli logarithms: one size for all
        size = np.sqrt(np.diag(hessian))
        step[moving] = np.linalg.solve(hessian / np.outer(size, size), -gradient[moving] / size) / size
        return step

    def _search(
        self, point: Point, linearised: Linearised, step: Floats
    ) -> tuple[tuple[Point, Linearised] | None, float, int]:
        """Halve the step until there is a stable equilibrium of a lower objective; None and 0 if there never is."""
        problem, mode = self.problem, self.problem.mode
        p = len(problem.parameters)
        slope = float(linearised.gradient @ step)
        share = min(1.0, 1.0 / max(float(np.max(np.abs(step[:p]) / problem.parameters.reach)), 1e-300))
        newton = 0
        for _ in range(12):
            theta = np.clip(point.state.theta + share * step[:p], mode.low, mode.high)
            # where derivatives say the state will be
            predicted = point.state.u + np.tensordot(theta - point.state.theta, linearised.du, axes=1)
            try:
                problem.parameters.require_possible(theta)
                state = problem.forward.solve_from(theta, (predicted, point.state.u))
                newton += state.newton_iterations
                trial = problem.at(state, point.nuisances + share * step[p:], point.noise)
                if trial.objective < point.objective + 1e-4 * share * slope:
                    return (trial, problem.linearise(trial)), share, newton
            except (InputError, SolveError):
                # an unstable law, no equilibrium, or one that is unstable: nearer to the last point there is none
                pass
            share *= 0.5
        return None, 0.0, newton


def _secant(hessian: Floats, step: Floats, change: Floats) -> Floats:
    """A Hessian that knows by how much the gradient changed along the last step (the update of BFGS).

    Gauss and Newton's leaves out what large residuals times second derivatives add, which makes it converge slowly
    where much of what was recorded is not explained.
    """
    along = float(change @ step)
    bent = hessian @ step
    expected = float(step @ bent)
    # a change of a tenth or of ten times what was expected is not of a neighbourhood that a parabola describes
    if not 0.1 * expected < along < 10.0 * expected:
        return hessian
    return hessian - np.outer(bent, bent) / expected + np.outer(change, change) / along


def require_explained(estimate: Estimate) -> None:
    """Raise `SolveError` if nearly all rows are gross errors: such an estimate is of nothing."""
    gross = estimate.point.known_noise.gross
    explained = int(np.count_nonzero(~gross))
    if explained < _FEWEST_EXPLAINED * len(gross):
        names = ", ".join(f"'{one.name}'" for one in estimate.problem.observations.recordings if one.unit == "m")
        raise SolveError(
            f"no estimate: {len(gross) - explained} of {len(gross)} rows recorded in {names} are gross errors, "
            "farther from what any parameters found make of them than their sigma allows; is the unit, the axes or "
            "the sigma wrong, or a cause left out?"
        )
