"""The check of Laplace's approximation by equilibria of some draws, and the chain that replaces it where it fails."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Bools, Floats
from warpbrain.errors import InputError, SolveError
from warpbrain.estimation.fit import Estimate, Laplace, probabilities
from warpbrain.estimation.forward import ROUGH, State
from warpbrain.estimation.problem import Point
from warpbrain.gp.prior import Prior

#: Degrees of freedom of the Student t around each estimate.
_NU = 7.0
#: A mode is looked at however improbable Laplace takes it to be, unless it is less probable than this.
_NEGLIGIBLE, _AT_LEAST = 1e-3, 0.05
#: Draws that tell how much of a t lies where its mode does.
_DRAWS = 4096
#: Laplace holds if weighted draws put the mean no farther away than this, in standard deviations, and the standard
#: deviations in this ratio or its inverse.
_SHIFT, _RATIO = 0.5, 1.4
#: Beyond this k weighted means do not converge.
RELIABLE = 0.7
#: Fewer weights in the tail than this tell nothing of its shape.
_FEWEST = 5
#: Steps of a chain a solve at most, that one may end which finds nothing; and the part of it that is forgotten.
_STEPS_A_SOLVE, _BURN_IN = 50, 0.2


class Target:
    """Log density of the posterior itself, up to a constant.

    That is the prior of the generative model, not its normal approximation, times the likelihood of an equilibrium that
    was solved, with the nuisances integrated out. States are predicted from the nearest mode, where solving starts.
    """

    def __init__(self, prior: Prior, modes: Sequence[Estimate]) -> None:
        self.prior, self.modes, self.problem = prior, tuple(modes), modes[0].problem
        #: Points whose laws were not stable, and points without an equilibrium.
        self.unstable = self.failed = 0

    def linearised(self, theta: Floats) -> float:
        """The log density where the state is what derivatives at the nearest estimate make of it."""
        mode = self._nearest(theta)
        try:
            self.problem.parameters.require_possible(theta)
        except InputError:
            return -np.inf
        return self._log_density(mode.predicted(theta), mode.point)

    def log_density(self, theta: Floats) -> float:
        """By an equilibrium; minus infinity where laws are unstable or there is none."""
        mode = self._nearest(theta)
        try:
            self.problem.parameters.require_possible(theta)
            state = self.problem.forward.solve_from(theta, (mode.predicted(theta).u, mode.point.state.u), ROUGH)
        except InputError:
            self.unstable += 1
            return -np.inf
        except SolveError:
            self.failed += 1
            return -np.inf
        return self._log_density(state, mode.point)

    def _nearest(self, theta: Floats) -> Estimate:
        """The mode that a point is nearest to, in its own standard deviations."""
        return min(self.modes, key=lambda mode: mode.laplace.posterior.negative_log(theta))

    def _log_density(self, state: State, start: Point) -> float:
        point = self.problem.at_best(self.problem.at(state, start.nuisances, start.noise))
        return float(self.prior.log_density(state.theta)) - point.misfit


@dataclass(frozen=True, eq=False)
class Proposal:
    """A mixture of Student t distributions, one around each estimate, cut off where its mode ends: heavier tails."""

    modes: tuple[Estimate, ...]

    @classmethod
    def of(cls, modes: Sequence[Estimate]) -> Proposal:
        """Around those that are probable at all."""
        kept = probabilities(modes) >= _NEGLIGIBLE
        return cls(tuple(mode for mode, keep in zip(modes, kept, strict=True) if keep))

    @cached_property
    def shares(self) -> Floats:
        """Of each mode in the mixture."""
        shares = np.maximum(probabilities(self.modes), _AT_LEAST)
        return shares / shares.sum()

    def draw(self, rng: np.random.Generator, count: int) -> Floats:
        """Draws (count, p)."""
        draws: list[Floats] = []
        for index in rng.choice(len(self.modes), size=count, p=self.shares).tolist():
            mode = self.modes[index]
            point = self._t(rng, mode, 1)
            while not self._inside(mode, point)[0]:
                point = self._t(rng, mode, 1)
            draws.append(point[0])
        return np.array(draws)

    def log_density(self, theta: Floats) -> Floats:
        """Log density (n,) at points (n, p)."""
        from scipy.special import logsumexp
        from scipy.stats import multivariate_t

        terms = []
        for mode, share, mass in zip(self.modes, self.shares, self._masses, strict=True):
            logs = multivariate_t.logpdf(theta, mode.theta, mode.laplace.posterior.covariance, _NU)
            terms.append(np.where(self._inside(mode, theta), logs + np.log(share / mass), -np.inf))
        return np.asarray(logsumexp(terms, axis=0), dtype=np.float64)

    @cached_property
    def _masses(self) -> Floats:
        """Part of each t that lies where its mode does."""
        rng = np.random.default_rng(0)
        return np.array([max(self._inside(m, self._t(rng, m, _DRAWS)).mean(), 1.0 / _DRAWS) for m in self.modes])

    @staticmethod
    def _t(rng: np.random.Generator, mode: Estimate, count: int) -> Floats:
        factor = mode.laplace.posterior.factor
        scale = np.sqrt(rng.chisquare(_NU, size=(count, 1)) / _NU)
        return np.asarray(mode.theta + rng.normal(size=(count, len(factor))) / scale @ factor.T)

    @staticmethod
    def _inside(mode: Estimate, theta: Floats) -> Bools:
        prior = mode.problem.mode
        return np.asarray(((theta >= prior.low) & (theta <= prior.high)).all(axis=1))


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Weights (n,) of sum 1, the largest replaced by the quantiles of the Pareto distribution that fits them.

    `k` is the shape of their tail, infinite if it cannot be told: up to 0.7 weighted means converge, beyond it a few
    samples carry everything (Vehtari, Simpson, Gelman, Yao and Gabry 2024, J. Mach. Learn. Res. 25, 72).
    """

    weights: Floats
    k: float

    @property
    def effective(self) -> float:
        """Number of equal weights that would tell as much."""
        return float(1.0 / np.sum(self.weights**2))


def pareto_smoothed(log_weights: Floats) -> Smoothed:
    """Smooth weights (n,), given as logarithms up to a constant; minus infinity for what is impossible."""
    largest = float(log_weights.max())
    if not np.isfinite(largest):
        return Smoothed(np.full(len(log_weights), 1.0 / len(log_weights)), np.inf)
    weights = np.exp(log_weights - largest)
    count = len(weights)
    tail = int(np.ceil(min(0.2 * count, 3.0 * np.sqrt(count))))
    order = np.argsort(weights)
    cut = weights[order[-tail - 1]] if tail < count else 0.0
    members = order[-tail:]
    above = weights[members] - cut
    if tail < _FEWEST or above[-1] <= 1e-12:
        # too few, or all alike
        return Smoothed(weights / weights.sum(), np.inf if tail < _FEWEST else 0.0)
    k, sigma = generalised_pareto(np.maximum(above, 1e-300))
    quantiles = (np.arange(tail) + 0.5) / tail
    spread = -np.log1p(-quantiles) if abs(k) < 1e-12 else np.expm1(-k * np.log1p(-quantiles)) / k
    # no weight beyond the largest that was seen
    weights[members] = np.minimum(cut + sigma * spread, 1.0)
    return Smoothed(weights / weights.sum(), k)


def generalised_pareto(x: Floats) -> tuple[float, float]:
    """Shape and scale of the generalised Pareto distribution of exceedances `x` (n,), increasing and positive.

    Its distribution function is `1 - (1 + k x / sigma)^(-1/k)`. The shape is Zhang and Stephens' quasi-Bayesian
    estimate (2009, Technometrics 51, 316), drawn a little towards 1/2, as Vehtari and others do with few exceedances.
    """
    from scipy.special import softmax

    n = len(x)
    points = 30 + int(np.sqrt(n))
    first_quartile = x[int(n / 4.0 + 0.5) - 1]
    theta = 1.0 / x[-1] + (1.0 - np.sqrt(points / (np.arange(1, points + 1) - 0.5))) / (3.0 * first_quartile)
    shapes = np.log1p(-theta[:, None] * x).mean(axis=1)
    log_likelihood = n * (np.log(-theta / shapes) - shapes - 1.0)
    best = float(np.sum(theta * softmax(log_likelihood)))
    k = float(np.log1p(-best * x).mean())
    return (n * k + 5.0) / (n + 10.0), -k / best


@dataclass(frozen=True, eq=False)
class Importance:
    """Weighted draws: the check of Laplace's approximation."""

    theta: Floats  # (n, p)
    log_densities: Floats  # (n,), of the posterior, up to a constant; minus infinity where there is no equilibrium
    smoothed: Smoothed
    unstable: int  # draws whose law was not stable, and draws without an equilibrium: their weight is zero
    failed: int

    @cached_property
    def mean(self) -> Floats:
        """Weighted, shape (p,)."""
        return np.asarray(self.smoothed.weights @ self.theta)

    @cached_property
    def standard_deviations(self) -> Floats:
        """Weighted, shape (p,)."""
        return np.sqrt(self.smoothed.weights @ (self.theta - self.mean) ** 2)

    def doubts(self, laplace: Laplace) -> tuple[str, ...]:
        """Why Laplace's approximation is not to be believed; empty if it is."""
        doubts = []
        if not self.smoothed.k <= RELIABLE:
            doubts.append(f"Pareto k is {self.smoothed.k:.2f}, above {RELIABLE}")
        deviations = laplace.posterior.standard_deviations
        # what as few draws say of a mean is itself uncertain by this many standard deviations
        error = 2.0 / np.sqrt(self.smoothed.effective)
        shift = np.abs(self.mean - laplace.theta) / deviations
        ratio = self.standard_deviations / deviations
        for name, away, times in zip(laplace.parameters.names, shift, ratio, strict=True):
            if away > _SHIFT + error:
                doubts.append(f"the mean of {name} is {away:.1f} standard deviations away")
            if not 1.0 / (_RATIO * (1.0 + error)) <= times <= _RATIO * (1.0 + error):
                doubts.append(f"the standard deviation of {name} is {times:.2f} times as large")
        return tuple(doubts)


def importance_sampling(
    target: Target,
    proposal: Proposal,
    count: int,
    rng: np.random.Generator,
    on_draw: Callable[[int], None] = lambda _number: None,
) -> Importance:
    """Weigh `count` draws of a proposal by a posterior; `on_draw` is called with the number of each."""
    theta = proposal.draw(rng, count)
    logs = np.empty(count)
    for number, point in enumerate(theta):
        logs[number] = target.log_density(point)
        on_draw(number + 1)
    smoothed = pareto_smoothed(logs - proposal.log_density(theta))
    return Importance(theta, logs, smoothed, target.unstable, target.failed)


@dataclass(frozen=True, eq=False)
class Chain:
    """Draws of the posterior."""

    theta: Floats  # (n, p), after the beginning, which is forgotten
    solves: int  # equilibria in all
    accepted: float  # part of the solved proposals that were taken
    effective: Floats  # (p,), independent draws that would tell as much of each parameter


def run_chain(
    target: Target,
    proposal: Proposal,
    start: Floats,
    solves: int,
    rng: np.random.Generator,
    on_solve: Callable[[int], None] = lambda _number: None,
) -> Chain:
    """Draw from a posterior by a Markov chain with delayed acceptance.

    A proposal must first pass with the state that derivatives at the estimate predict, which costs no equilibrium; only
    then is its equilibrium solved, and what the prediction got wrong decides (Christen and Fox 2005, J. Comput. Graph.
    Stat. 14, 795). Proposals are steps in turn with draws of the mixture around all estimates, which cross from one
    mode of Ogden's exponents to another. At most `solves` equilibria are solved, of each of which the
    number is told. `SolveError` if there is none at the start (p,).
    """
    here, cheap = target.log_density(start), target.linearised(start)
    if not np.isfinite(here):
        raise SolveError(f"a chain cannot start from theta = {start.tolist()}: there is no equilibrium")
    theta, path = start, [start]
    done, accepted = 1, 0
    # one size of step wherever it starts, or there would be no way back
    step = 1.7 / np.sqrt(len(theta)) * proposal.modes[0].laplace.posterior.factor
    while done < solves and len(path) < _STEPS_A_SOLVE * solves:
        # a point, and the log ratio of coming back to going there
        if rng.uniform() < 0.5:
            trial = proposal.draw(rng, 1)[0]
            back, there = proposal.log_density(np.array([theta, trial]))
            balance = float(back - there)
        else:
            trial, balance = theta + step @ rng.normal(size=len(theta)), 0.0
        cheap_there = target.linearised(trial)
        if np.log(rng.uniform()) < cheap_there - cheap + balance:
            there = target.log_density(trial)
            done += 1
            on_solve(done)
            # the share that the first stage has decided already is taken off
            if np.log(rng.uniform()) < (there - here) - (cheap_there - cheap):
                theta, here, cheap = trial, there, cheap_there
                accepted += 1
        path.append(theta)
    kept = np.array(path[int(_BURN_IN * len(path)) :])
    return Chain(kept, done, accepted / max(done - 1, 1), np.array([effective_size(column) for column in kept.T]))


def effective_size(values: Floats) -> float:
    """Independent draws that tell as much of the mean as a chain (n,): Geyer's initial positive sequence (1992)."""
    n = len(values)
    away = values - values.mean()
    variance = float(away @ away) / n
    if variance == 0.0:
        return 1.0
    padded = np.fft.rfft(away, 2 * n)
    autocorrelation = np.fft.irfft(np.abs(padded) ** 2)[:n] / (n * variance)
    pairs = autocorrelation[: 2 * (n // 2)].reshape(-1, 2).sum(axis=1)
    first_negative = int(np.argmax(pairs < 0.0)) if (pairs < 0.0).any() else len(pairs)
    time = max(2.0 * float(pairs[:first_negative].sum()) - 1.0, 1.0)
    return n / time
