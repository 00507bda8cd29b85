"""The most probable parameters: least squares on likelihood and prior, solving equilibrium from the last state.

SciPy's least squares (`scipy.optimize.least_squares`) takes damped steps of Gauss and Newton within the range of
parameters. Each equilibrium is begun where the derivatives of the last better one (`warpbrain.simulation.sensitivity`)
say it will be. A step to where there is none is shortened.

Far from the estimate most of a residual is no noise yet. So the noise is first taken to be as large as the residuals
say, again and again; then noise and estimate are found in turn, see `likelihood`.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import InputError, SolveError
from warpbrain.estimation.forward import State
from warpbrain.estimation.likelihood import IndependentNoise, Noise
from warpbrain.estimation.modes import Estimate, GaussNewtonStep
from warpbrain.estimation.problem import Linearised, Point, Problem

#: How often a first state is tried at moduli larger by a factor of e.
_STIFFER = 4
#: There is no estimate if fewer rows than this share are something else.
_FEWEST_EXPLAINED = 0.1
#: Tolerance while noise is not known yet, how often it is found again, and until it changes by less than this part.
_ROUGHLY, _ROUNDS, _SETTLED = 0.1, 8, 0.1
#: Equilibria at most with each noise, and changes, relative, of coordinates and objective that are none.
_ITERATIONS, _LEAST_STEP, _ROUNDING = 60, 1e-7, 1e-12


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
            point, linearised = self._roughly(*self._first(values))
        else:
            point = problem.at(start, values)
            linearised = problem.linearise(point)
        for number in range(_ROUNDS):
            last = point.noise
            point = problem.with_likely_noise(point, linearised)
            settled = isinstance(last, Noise) and point.known_noise.is_near(last)
            tolerance = self.tolerance if number else max(_ROUGHLY, self.tolerance)
            point, linearised, converged = self._descend(point, linearised, tolerance)
            if settled:
                break
        linearised = problem.linearise(point, (linearised.du, linearised.dR))
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

    def _roughly(self, point: Point, linearised: Linearised) -> tuple[Point, Linearised]:
        """Downhill with noise as large as what is left each time."""
        for _ in range(_ROUNDS):
            last = point.noise
            point, linearised, _ = self._descend(point, linearised, _ROUGHLY)
            point = self.problem.at(point.state, point.nuisances)
            assert isinstance(last, IndependentNoise) and isinstance(point.noise, IndependentNoise)
            if np.abs(np.log(point.noise.sigma / last.sigma)).max() < _SETTLED:
                break
        return point, linearised

    def _descend(self, point: Point, linearised: Linearised, tolerance: float) -> tuple[Point, Linearised, bool]:
        """Downhill with one noise to where a step is no longer worth it."""
        from scipy.optimize import least_squares

        descent = _Descent(self, point, linearised, tolerance)
        with contextlib.suppress(_ConvergedError):
            least_squares(
                descent.residuals, np.zeros_like(descent.low), descent.jacobian, (descent.low, descent.high),
                method="dogbox" if np.isfinite([descent.low, descent.high]).any() else "trf",
                ftol=_ROUNDING, xtol=_LEAST_STEP, gtol=None, max_nfev=_ITERATIONS,
            )  # fmt: skip
        # farther away it is rounding of the objective, or nothing better lies this way
        return descent.point, descent.linearised, descent.decrement <= 10.0 * tolerance

    def record(self, objective: float, decrement: float, share: float, newton: int) -> None:
        """Take notice of a step; see `GaussNewtonStep`."""
        self._history.append(GaussNewtonStep(len(self._history) + 1, objective, decrement, share, newton))
        if self._on_step is not None:
            self._on_step(self._history[-1])


class _ConvergedError(Exception):
    """The next step is shorter than the tolerance."""


class _Descent:
    """What least squares asks for: rows and prior in standard deviations, and their derivatives.

    Coordinates are steps from the start in units of the reach of a parameter, and of ten standard deviations of what is
    estimated along, since the first step goes no farther than one unit.
    """

    def __init__(self, search: GaussNewton, point: Point, linearised: Linearised, tolerance: float) -> None:
        self.problem = problem = search.problem
        self.point, self.linearised, self.decrement = point, linearised, np.inf
        self._search, self._tolerance, self._start = search, tolerance, point
        self._origin, along = point.coordinates, problem.nuisances.prior.standard_deviations
        self._scale = np.concatenate([problem.parameters.reach, 10.0 * along])
        open_ends = np.full(len(along), np.inf)
        low, high = np.append(problem.mode.low, -open_ends), np.append(problem.mode.high, open_ends)
        self.low = np.minimum((low - self._origin) / self._scale, 0.0)
        self.high = np.maximum((high - self._origin) / self._scale, 0.0)
        self._whitening = np.linalg.inv(problem.prior.factor)
        self._better: tuple[Point, Linearised] | None = None
        self._newton = 0
        self._last = np.zeros_like(self.low), np.zeros((0, len(self.low)))

    def residuals(self, z: Floats) -> Floats:
        """At coordinates (k,): (n + k,), not finite where there is no stable equilibrium."""
        if not z.any():
            return self._standardised(self._start)
        problem, here = self.problem, self.point.state
        x = self._origin + self._scale * z
        theta, nuisances = np.split(x, [len(problem.parameters)])
        # where derivatives say the state will be
        predicted = here.u + np.tensordot(theta - here.theta, self.linearised.du, axes=1)
        try:
            problem.parameters.require_possible(theta)
            state = problem.forward.solve_from(theta, (predicted, here.u))
            self._newton += state.newton_iterations
            point = problem.at(state, nuisances, self.point.noise)
            if point.objective < self.point.objective:
                self._better = point, problem.linearise(point)
            return self._standardised(point)
        except (InputError, SolveError):
            # an unstable law, no equilibrium, or one that is unstable: nearer to the last point there is none
            return np.full(len(here.theta) + len(self.point.residual) + len(nuisances), np.nan)

    def jacobian(self, z: Floats) -> Floats:
        """Of the last point that was better, (n + k, k); `_ConvergedError` if no further step is worth it."""
        if self._better is not None:
            objective, (self.point, self.linearised) = self.point.objective, self._better
            before, J = self._last
            share = float(np.linalg.norm(J @ (z - before))) / self.decrement
            self._search.record(objective, self.decrement, share, self._newton)
            self._newton, self._better = 0, None
        white = self.point.noise.standardised(self.linearised.jacobian)
        J = np.concatenate([white, self._whitening]) * self._scale
        residuals = self._standardised(self.point)
        gradient = J.T @ residuals
        moving = ~((z <= self.low) & (gradient > 0.0) | (z >= self.high) & (gradient < 0.0))
        self.decrement = float(np.linalg.norm(np.linalg.qr(J[:, moving])[0].T @ residuals))
        if self.decrement <= self._tolerance:
            raise _ConvergedError
        self._last = z.copy(), J
        return J

    def _standardised(self, point: Point) -> Floats:
        white = point.noise.standardised(point.residual)
        return np.concatenate([white, self._whitening @ (point.coordinates - self.problem.prior.mean)])


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
