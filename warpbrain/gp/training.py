"""Training of the coregionalised process: the parameters of largest marginal likelihood.

The likelihood has many optima: a group can follow the curve that all share (large `w`) or go its own way (small `w`,
large `kappa`), and no climb leads from one to the other. So, on a thinned set of stretches, which costs seconds, all
groups are taken together first and then each in turn is set apart; the arrangement that ends lowest is climbed from on
all stretches. Each climb takes Levenberg-damped scoring steps with the average information of `likelihood`.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from warpbrain.arrays import Bools, Floats
from warpbrain.errors import SolveError
from warpbrain.gp.likelihood import TASKS, Likelihood, Parameters, Replicates

#: Variance added to the diagonal of the covariance, as in the paper's training.
JITTER = 1e-8
#: Of a climb on all observations, at most.
_ITERATIONS = 200
#: Free parameters stay between these, (length, w, kappa, noise): what is beyond changes nothing.
_LOWEST = np.repeat([np.log(1e-2), -1e4, np.log(1e-10), np.log(1e-12)], [1, TASKS, TASKS, TASKS])
_HIGHEST = np.repeat([np.log(1e1), 1e4, np.log(1e5), np.log(1e3)], [1, TASKS, TASKS, TASKS])
#: Largest step of a logarithm in one iteration: the length scale, the variances.
_LONGEST = np.repeat([0.5, np.inf, 3.0, 3.0], [1, TASKS, TASKS, TASKS])


@dataclass(frozen=True, eq=False)
class Climb:
    """Where one optimisation ended."""

    parameters: Parameters
    value: float  # negative log marginal likelihood
    converged: bool  # an iteration gained less than was asked for before they ran out
    iterations: int
    evaluations: int
    gain: float  # what the last iteration lowered the value by
    gradient: float  # largest derivative by a free parameter
    condition: float  # of the covariance


@dataclass(frozen=True, eq=False)
class Start:
    """A climb on the thinned stretches, and the group that was set apart at its start, if any."""

    apart: int | None
    climb: Climb


@dataclass(frozen=True, eq=False)
class Training:
    """Climbs on all observations, and starts on every `step`-th stretch, both best first.

    Starts whose covariance could not be factored are not there.
    """

    climbs: tuple[Climb, ...]
    starts: tuple[Start, ...]
    step: int
    kernel: str

    @property
    def best(self) -> Climb:
        """The climb that ended lowest."""
        return self.climbs[0]


def train(
    data: Replicates,
    kernel: str = "matern32",
    *,
    climbs: int = 1,
    step: int = 5,
    gain: float = 1e-2,
    progress: Callable[[float, str], None] = lambda part, said: None,
) -> Training:
    """Train on the means of replicates; `SolveError` if the covariance cannot be factored at any start.

    `climbs` are of the best starts, on all observations; starts are compared on every `step`-th stretch. A climb has
    converged when an iteration lowers the negative log likelihood by less than the `gain`. `progress` is told the part
    done, 0 to 1, and what is going on.
    """
    thinned, whole = (Likelihood(d, kernel, JITTER) for d in (data.thinned(step), data))
    progress(0.0, "all groups together")
    together = Start(None, climb(thinned, start(data), gain, 80))
    starts = [together]
    present = np.unique(data.task)
    for index, group in enumerate(present.tolist()):
        progress(0.1 + 0.15 * index / len(present), f"one group apart, {index + 1} of {len(present)}")
        with suppress(SolveError):
            starts.append(Start(group, climb(thinned, _apart(together.climb.parameters, group), gain, 25)))
    starts.sort(key=lambda begun: begun.climb.value)
    ended: list[Climb] = []

    def report(iteration: int, value: float) -> None:
        part = 0.25 + 0.75 * (len(ended) + iteration / _ITERATIONS) / climbs
        progress(part, f"climb {len(ended) + 1} of {climbs}, negative log likelihood {value:.2f}")

    for begun in starts:
        with suppress(SolveError):
            ended.append(climb(whole, start(data, begun.apart), gain, _ITERATIONS, report))
        if len(ended) == climbs:
            break
    if not ended:
        raise SolveError(
            f"none of {len(starts)} starts has a covariance that double precision can factor (jitter {JITTER:g})"
        )
    ended.sort(key=lambda climbed: climbed.value)
    return Training(tuple(ended), tuple(starts), step, kernel)


def start(data: Replicates, apart: int | None = None) -> Parameters:
    """Parameters to start from: noise as the replicates scatter, all groups but `apart` on the shared curve."""
    degrees = np.bincount(data.task, weights=data.count - 1, minlength=TASKS)
    scatter = np.bincount(data.task, weights=data.scatter, minlength=TASKS)
    noise = np.maximum(scatter / np.maximum(degrees, 1.0), 1e-6)
    together = Parameters(0.15, np.full(TASKS, 100.0), np.ones(TASKS), noise)
    return together if apart is None else _apart(together, apart)


def _apart(parameters: Parameters, group: int) -> Parameters:
    """The same, but for a group that shares nothing and varies by itself."""
    w, kappa = parameters.w.copy(), parameters.kappa.copy()
    w[group], kappa[group] = 1.0, max(kappa[group], 5e-3 * w[group] ** 2)
    return replace(parameters, w=w, kappa=kappa)


def climb(
    likelihood: Likelihood,
    first: Parameters,
    gain: float,
    iterations: int,
    progress: Callable[[int, float], None] = lambda iteration, value: None,
) -> Climb:
    """Lower the negative log likelihood from given parameters; `SolveError` if it cannot be computed there."""
    x = np.clip(first.to_vector(), _LOWEST, _HIGHEST)
    value, gradient, information = likelihood.value_gradient_and_information(Parameters.from_vector(x))
    damping, evaluations, iteration, gained, converged = 1e-2, 1, 0, np.inf, False
    while iteration < iterations and damping < 1e8:
        progress(iteration, value)
        proposed = _step(x, gradient, information, damping)
        try:
            after = likelihood.value_gradient_and_information(Parameters.from_vector(proposed))
            evaluations += 1
        except SolveError:
            after = (np.inf, gradient, information)
        iteration += 1
        if after[0] >= value:
            damping *= 6.0
            continue
        gained = value - after[0]
        x, (value, gradient, information), damping = proposed, after, max(damping / 4.0, 1e-6)
        if gained < gain:
            converged = True
            break
    parameters, steepest = Parameters.from_vector(x), float(np.abs(gradient[_free(x, gradient)]).max())
    condition = likelihood.factor(parameters).condition
    return Climb(parameters, value, converged, iteration, evaluations, float(gained), steepest, condition)


def _free(x: Floats, gradient: Floats) -> Bools:
    """Which parameters are not held at the end of their range."""
    return ~(((x <= _LOWEST) & (gradient > 0.0)) | ((x >= _HIGHEST) & (gradient < 0.0)))


def _step(x: Floats, gradient: Floats, information: Floats, damping: float) -> Floats:
    free = _free(x, gradient)
    scale = np.maximum(np.diag(information), 1e-6)
    # a w of no influence yet must not run away
    scale[1 : 1 + TASKS] = np.maximum(scale[1 : 1 + TASKS], 1e-4)
    matrix = (information + damping * np.diag(scale))[np.ix_(free, free)]
    step = np.zeros_like(x)
    step[free] = -np.linalg.solve(matrix, gradient[free])
    return np.clip(x + np.clip(step, -_LONGEST, _LONGEST), _LOWEST, _HIGHEST)
