"""The most probable parameters, and the posterior as the normal distribution that fits it there (Laplace).

Each equilibrium on the way is begun where the derivatives of the last better one (`warpbrain.simulation.sensitivity`)
say it will be. Noise and estimate are found in turn: about each point the noise that is likely with everything that is
estimated integrated out, see `likelihood`, and with that noise the estimate.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import InputError, SolveError
from warpbrain.estimation.forward import State
from warpbrain.estimation.likelihood import Noise
from warpbrain.estimation.parameters import Gaussian, Parameters
from warpbrain.estimation.problem import Linearised, Point, Problem
from warpbrain.inference.least_squares import minimise

#: How often a first state is tried at moduli larger by a factor of e.
_STIFFER = 4
#: There is no estimate if fewer rows than this share are something else.
_FEWEST_EXPLAINED = 0.1
#: Tolerance while noise is not known yet, and how often it is found again.
_ROUGHLY, _ROUNDS = 0.1, 8


@dataclass(frozen=True, eq=False)
class Laplace:
    """A normal posterior of the parameters.

    Beside the prior covariance `L L^T` the measure of the information `I` of the data alone is `L^T I L`: along an
    eigenvector of the eigenvalue `e` the data know `e` times as much as the prior, and the variance falls to
    `1/(1 + e)` of what it was.
    """

    parameters: Parameters
    theta: Floats  # (p,), its mean: the estimate
    prior: Gaussian
    information: Floats  # (p, p)

    @cached_property
    def posterior(self) -> Gaussian:
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
        prior = self.problem.mode.gaussian
        return Laplace(self.problem.parameters, self.theta, prior, self.linearised.information)

    @cached_property
    def log_evidence(self) -> float:
        """Log probability of what was recorded and of this mode, by Laplace, up to what all modes have in common."""
        prior = self.problem.mode
        log_volume = 0.5 * float(np.linalg.slogdet(self.laplace.posterior.covariance)[1])
        log_volume -= float(np.log(np.diag(prior.gaussian.factor)).sum())
        return float(np.log(prior.share)) + log_volume - self.point.objective

    def predicted(self, theta: Floats) -> State:
        """The state of other parameters, to first order about the estimate."""
        at, step = self.point.state, theta - self.theta
        u, R = (np.tensordot(step, each, axes=1) for each in self.linearised.derivatives)
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

    def __init__(self, problem: Problem, tolerance: float, on_step: Callable[[GaussNewtonStep], None]) -> None:
        self.problem, self.tolerance, self._on_step = problem, tolerance, on_step
        self._history: list[GaussNewtonStep] = []

    def solve(self, start: Estimate | None = None) -> Estimate:
        """Go to the estimate from one with other nuisances, or from the middle of the prior.

        `InputError` if the laws there are not stable, `SolveError` if there is no equilibrium to start from.
        """
        problem, prior = self.problem, self.problem.nuisances.prior
        nuisances = prior.mean.copy()
        if start is None:
            state, derivatives = self._first()
        else:
            state, derivatives = start.point.state, start.linearised.derivatives
            known = start.point.nuisances
            nuisances[len(nuisances) - len(known) :] = known
        last: Noise | None = None
        for number in range(_ROUNDS):
            noise = problem.likely_noise(state, nuisances, derivatives)
            settled = last is not None and noise.is_near(last)
            point = problem.at(state, nuisances, noise)
            tolerance = self.tolerance if number else max(_ROUGHLY, self.tolerance)
            point, linearised, left = self._descend(point, problem.linearise(point, derivatives), tolerance)
            derivatives = linearised.derivatives
            point = problem.at_best(problem.at(point.state, nuisances, noise))
            state, nuisances, last = point.state, point.nuisances, noise
            if settled:
                break
        linearised = problem.linearise(point, derivatives)
        # farther away it is rounding of the objective, or nothing better lies this way
        return Estimate(problem, point, linearised, left <= 10.0 * tolerance, tuple(self._history))

    def _first(self) -> tuple[State, tuple[Floats, Floats]]:
        """The middle of the prior, and its derivatives; something stiffer if there is no stable equilibrium."""
        problem, mode = self.problem, self.problem.mode
        theta = np.clip(mode.gaussian.mean, mode.low, mode.high)
        problem.parameters.require_possible(theta)
        stiffer = problem.parameters.is_modulus.astype(np.float64)
        why = ""
        for times in range(_STIFFER + 1):
            try:
                state = problem.forward.solve(theta + times * stiffer)
                return state, problem.forward.differentiate(state)
            except SolveError as error:
                why = str(error)
        raise SolveError(f"in the middle of the prior, and up to {math.exp(_STIFFER):.0f} times stiffer: {why}")

    def _descend(self, start: Point, linearised: Linearised, tolerance: float) -> tuple[Point, Linearised, float]:
        """Downhill with one noise to where a step is no longer worth it; and how long it is.

        Coordinates are steps from the start in units of the reach of a parameter, since the first step goes no farther
        than one unit.
        """
        problem, mode, newton = self.problem, self.problem.mode, 0
        best = trial = start, linearised
        scale, whitening = problem.parameters.reach, np.linalg.inv(mode.gaussian.factor)
        x0 = start.state.theta
        bounds = np.minimum((mode.low - x0) / scale, 0.0), np.maximum((mode.high - x0) / scale, 0.0)

        def rows(z: Floats) -> Floats:
            """In standard deviations, those of the prior among them."""
            nonlocal newton, trial
            there = start
            if z.any():
                theta = x0 + scale * z
                problem.parameters.require_possible(theta)
                here, about = best
                # where derivatives say the state will be
                predicted = here.state.u + np.tensordot(theta - here.state.theta, about.derivatives[0], axes=1)
                state = problem.forward.solve_from(theta, (predicted, here.state.u))
                newton += state.newton_iterations
                there = problem.at(state, start.nuisances, start.noise, start.model)
                if there.objective < here.objective:
                    trial = there, problem.linearise(there)
            white = start.model.standardised(there.residual)
            return np.concatenate([white, whitening @ (there.state.theta - mode.gaussian.mean)])

        def columns(_z: Floats) -> Floats:
            nonlocal best
            best = trial
            return np.concatenate([-start.model.standardised(best[1].columns), whitening]) * scale

        def on_step(decrement: float, share: float) -> None:
            nonlocal newton
            step = GaussNewtonStep(len(self._history) + 1, best[0].objective, decrement, share, newton)
            newton = 0
            self._history.append(step)
            self._on_step(step)

        # an unstable law, no equilibrium, or one that is unstable: nearer to the last point there is none
        fails = InputError, SolveError
        z = np.zeros_like(x0)
        _, left = minimise(rows, columns, z, tolerance, bounds=bounds, cannot_be=fails, on_step=on_step)
        return *best, left
