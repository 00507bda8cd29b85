"""The most probable parameters, and the posterior as the normal distribution that fits it there (Laplace).

Each equilibrium on the way is begun where the derivatives of the last better one (`warpbrain.simulation.sensitivity`)
say it will be. Far from the estimate most of a residual is no noise yet. So the noise is first taken to be as large as
the residuals say, again and again; then noise and estimate are found in turn, see `likelihood`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import InputError, SolveError
from warpbrain.estimation.forward import State
from warpbrain.estimation.likelihood import IndependentNoise
from warpbrain.estimation.parameters import Gaussian, Parameters
from warpbrain.estimation.problem import Linearised, Point, Problem
from warpbrain.inference.least_squares import minimise

#: How often a first state is tried at moduli larger by a factor of e.
_STIFFER = 4
#: There is no estimate if fewer rows than this share are something else.
_FEWEST_EXPLAINED = 0.1
#: Tolerance while noise is not known yet, how often it is found again, and until it changes by less than this part.
_ROUGHLY, _ROUNDS, _SETTLED = 0.1, 8, 0.1


@dataclass(frozen=True, eq=False)
class Laplace:
    """A normal posterior of the parameters.

    Nuisances are integrated out: the information of the data alone, `I`, is that of `theta` less what the nuisances
    could explain as well (its Schur complement). Beside the prior covariance `L L^T` its measure is `L^T I L`: along an
    eigenvector of the eigenvalue `e` the data know `e` times as much as the prior, and the variance falls to
    `1/(1 + e)` of what it was.
    """

    parameters: Parameters
    theta: Floats  # (p,), its mean: the estimate
    prior: Gaussian
    information: Floats  # (p, p)

    @classmethod
    def of(cls, problem: Problem, theta: Floats, linearised: Linearised) -> Laplace:
        """The posterior at the most probable parameters (p,) of a problem, linearised there."""
        p = len(problem.parameters)
        information, joint = linearised.information[:p, :p], linearised.hessian
        # metres, radians and plain numbers: one size for all
        size = np.sqrt(np.diag(joint[p:, p:]))
        mixed = joint[p:, :p] / size[:, None]
        information = information - mixed.T @ np.linalg.solve(joint[p:, p:] / np.outer(size, size), mixed)
        return cls(problem.parameters, theta, problem.mode.gaussian, information)

    @cached_property
    def posterior(self) -> Gaussian:
        """As a distribution."""
        # in the prior's own measure, where nothing is too large or too small to be inverted
        values, vectors = self._eigen
        basis = self.prior.factor @ vectors
        return Gaussian(self.theta, np.asarray(basis / (1.0 + values) @ basis.T))

    def interval(self, probability: float = 0.95) -> Floats:
        """Central interval of each parameter, shape (p, 2), no farther than its range goes."""
        from scipy.special import ndtri

        away = ndtri(0.5 + 0.5 * probability) * self.posterior.standard_deviations
        ends = np.stack([self.theta - away, self.theta + away], axis=1)
        return np.clip(ends, self.parameters.low[:, None], self.parameters.high[:, None])

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
        # information is never negative: what is, is rounding
        return np.maximum(values[::-1], 0.0), vectors[:, ::-1]


def _normalised(columns: Floats) -> Floats:
    """Columns as rows whose largest entry is 1."""
    largest = np.take_along_axis(columns, np.abs(columns).argmax(axis=0)[None], axis=0)
    return np.asarray((columns / largest).T, dtype=np.float64)


@dataclass(frozen=True)
class GaussNewtonStep:
    """One line of the history."""

    iteration: int  # from 1
    objective: float  # `-ln` of likelihood times prior, before the step
    decrement: float  # length of the whole step in standard deviations of the posterior
    step: float  # share of it that was taken
    newton_iterations: int  # of all equilibria that were tried


@dataclass(frozen=True, eq=False)
class Estimate:
    """The most probable parameters: a top of the posterior, with what the problem is to first order there."""

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
        misfit, _ = self.problem.without_nuisances(point.state, point.nuisances, point.noise)
        log_volume = 0.5 * float(np.linalg.slogdet(self.laplace.posterior.covariance)[1])
        log_volume -= float(np.log(np.diag(prior.gaussian.factor)).sum())
        return float(np.log(prior.share)) + log_volume - misfit - prior.gaussian.negative_log(self.theta)

    def predicted(self, theta: Floats) -> State:
        """The state of other parameters, to first order about the estimate."""
        at, step = self.point.state, theta - self.theta
        u, R = (np.tensordot(step, each, axes=1) for each in (self.linearised.du, self.linearised.dR))
        return State(theta, at.u + u, at.reactions + R, 0)

    def require_explained(self) -> None:
        """Raise `SolveError` if nearly all rows are gross errors: such an estimate is of nothing."""
        gross = self.point.noise.gross
        explained = int(np.count_nonzero(~gross))
        if explained < _FEWEST_EXPLAINED * len(gross):
            names = ", ".join(f"'{each.name}'" for each in self.problem.observations.recordings if each.unit == "m")
            raise SolveError(
                f"no estimate: {len(gross) - explained} of {len(gross)} rows recorded in {names} are gross errors, "
                "farther from what any parameters found make of them than their sigma allows; is the unit, the axes or "
                "the sigma wrong, or a cause left out?"
            )


def probabilities(modes: Sequence[Estimate]) -> Floats:
    """Of each mode after the observation, their sum is 1."""
    from scipy.special import softmax

    return np.asarray(softmax([mode.log_evidence for mode in modes]), dtype=np.float64)


class GaussNewton:
    """Looks for the most probable parameters of a problem; `on_step` is called with each step.

    Converged when the next step is shorter than `tolerance` in standard deviations of the posterior.
    """

    def __init__(
        self, problem: Problem, tolerance: float = 1e-3, on_step: Callable[[GaussNewtonStep], None] | None = None
    ) -> None:
        self.problem = problem
        self.tolerance = tolerance
        self._on_step = on_step
        self._history: list[GaussNewtonStep] = []

    def solve(self, start: State | None = None, nuisances: Floats | None = None) -> Estimate:
        """Go from a state and nuisances (q,) to the estimate.

        By default from the middle of the prior, and then the first stage is that of large residuals: `InputError` if
        its laws are not stable, `SolveError` if there is no equilibrium to start from.
        """
        problem = self.problem
        values = problem.nuisances.prior.mean if nuisances is None else nuisances
        self._history = []
        if start is None:
            point, linearised = self._first(values)
            # downhill with noise as large as what is left each time
            for _ in range(_ROUNDS):
                last = point.noise
                point, linearised, _ = self._descend(point, linearised, _ROUGHLY)
                point = problem.at(point.state, point.nuisances)
                if np.abs(np.log(point.noise.sigma / last.sigma)).max() < _SETTLED:
                    break
        else:
            point = problem.at(start, values)
            linearised = problem.linearise(point)
        for number in range(_ROUNDS):
            last = point.noise
            point = problem.with_likely_noise(point, linearised)
            settled = not isinstance(last, IndependentNoise) and point.noise.is_near(last)
            tolerance = self.tolerance if number else max(_ROUGHLY, self.tolerance)
            point, linearised, left = self._descend(point, linearised, tolerance)
            if settled:
                break
        linearised = problem.linearise(point, (linearised.du, linearised.dR))
        # farther away it is rounding of the objective, or nothing better lies this way
        return Estimate(problem, point, linearised, left <= 10.0 * tolerance, tuple(self._history))

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

    def _descend(self, point: Point, linearised: Linearised, tolerance: float) -> tuple[Point, Linearised, float]:
        """Downhill with one noise to where a step is no longer worth it; and how long it is.

        Coordinates are steps from the start in units of the reach of a parameter, and of ten standard deviations of
        what is estimated along, since the first step goes no farther than one unit.
        """
        problem, start, newton = self.problem, point, 0
        best, trial = (point, linearised), (point, linearised)
        along = problem.nuisances.prior.standard_deviations
        scale = np.concatenate([problem.parameters.reach, 10.0 * along])
        whitening = np.linalg.inv(problem.prior.factor)
        open_ends = ((problem.mode.low, -np.inf), (problem.mode.high, np.inf))
        low, high = (np.pad(end, (0, len(along)), constant_values=sign) for end, sign in open_ends)
        x0 = start.coordinates
        bounds = np.minimum((low - x0) / scale, 0.0), np.maximum((high - x0) / scale, 0.0)

        def rows(z: Floats) -> Floats:
            """In standard deviations, those of the prior among them."""
            nonlocal newton, trial
            there = start
            if z.any():
                theta, nuisances = np.split(x0 + scale * z, [len(problem.parameters)])
                problem.parameters.require_possible(theta)
                here, derivatives = best
                # where derivatives say the state will be
                predicted = here.state.u + np.tensordot(theta - here.state.theta, derivatives.du, axes=1)
                state = problem.forward.solve_from(theta, (predicted, here.state.u))
                newton += state.newton_iterations
                there = problem.at(state, nuisances, start.noise)
                if there.objective < here.objective:
                    trial = there, problem.linearise(there)
            white = start.noise.standardised(there.rows.residual)
            return np.concatenate([white, whitening @ (there.coordinates - problem.prior.mean)])

        def columns(_z: Floats) -> Floats:
            nonlocal best
            best = trial
            return np.concatenate([start.noise.standardised(best[1].jacobian), whitening]) * scale

        def on_step(decrement: float, share: float) -> None:
            nonlocal newton
            step = GaussNewtonStep(len(self._history) + 1, best[0].objective, decrement, share, newton)
            newton = 0
            self._history.append(step)
            if self._on_step is not None:
                self._on_step(step)

        # an unstable law, no equilibrium, or one that is unstable: nearer to the last point there is none
        fails = InputError, SolveError
        z = np.zeros_like(x0)
        _, left = minimise(rows, columns, z, tolerance, bounds=bounds, cannot_be=fails, on_step=on_step)
        return *best, left
