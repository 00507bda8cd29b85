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
#: Free parameters stay between these, (length, w, kappa, noise): what is beyond changes nothing.
_LOWEST = np.repeat([np.log(1e-2), -1e4, np.log(1e-10), np.log(1e-12)], [1, TASKS, TASKS, TASKS])
_HIGHEST = np.repeat([np.log(1e1), 1e4, np.log(1e5), np.log(1e3)], [1, TASKS, TASKS, TASKS])
#: Largest step of a logarithm in one iteration: the length scale, the variances.
_LONGEST = np.repeat([0.5, np.inf, 3.0, 3.0], [1, TASKS, TASKS, TASKS])


@dataclass(frozen=True, eq=False)
class Climb:
    """Where one optimisation ended.

    `value` is the negative log marginal likelihood, `gain` what the last iteration lowered it by, `gradient` its
    largest derivative by a free parameter, `condition` that of the covariance; it `converged` if an iteration gained
    less than was asked for before they ran out.
    """

    parameters: Parameters
    value: float
    converged: bool
    iterations: int
    evaluations: int
    gain: float
    gradient: float
    condition: float


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
    jitter: float
    kernel: str

    @property
    def best(self) -> Climb:
        """The climb that ended lowest."""
        return self.climbs[0]


def train(
    data: Replicates,
    kernel: str = "matern32",
    *,
    jitter: float = JITTER,
    climbs: int = 1,
    step: int = 5,
    gain: float = 1e-2,
    iterations: int = 200,
    progress: Callable[[float, str], None] = lambda part, said: None,
) -> Training:
    """Train on the means of replicates.

    Parameters
    ----------
    data : Replicates
    kernel : str
        One of `warpbrain.gp.kernels.KERNELS`.
    jitter : float
        Variance added to the diagonal.
    climbs : int
        From how many of the best starts to climb on all observations.
    step : int
        Starts are compared on every `step`-th stretch.
    gain : float
        Converged when an iteration lowers the negative log likelihood by less.
    iterations : int
        At most, of a climb on all observations.
    progress : callable
        Is told the part done, 0 to 1, and what is going on.

    Raises
    ------
    SolveError
        If the covariance cannot be factored at any start.
    """
    thinned, whole = (Likelihood(d, kernel, jitter) for d in (data.thinned(step), data))
    progress(0.0, "all groups together")
    together = Start(None, climb(thinned, start(data), gain, 80))
    starts = [together]
    present = np.unique(data.task)
    for index, group in enumerate(present.tolist()):
        progress(0.1 + 0.15 * index / len(present), f"one group apart, {index + 1} of {len(present)}")
        with suppress(SolveError):
            starts.append(Start(group, climb(thinned, _apart(together.climb.parameters, group), gain, 25)))
    starts.sort(key=lambda one: one.climb.value)
    found: list[Climb] = []
    for one in starts:
        done = len(found) / climbs

        def told(iteration: int, value: float, done: float = done) -> None:
            part = 0.25 + 0.75 * (done + iteration / iterations / climbs)
            progress(part, f"climb {len(found) + 1} of {climbs}, negative log likelihood {value:.2f}")

        with suppress(SolveError):
            found.append(climb(whole, start(data, one.apart), gain, iterations, told))
        if len(found) == climbs:
            break
    if not found:
        raise SolveError(
            f"none of {len(starts)} starts has a covariance that double precision can factor (jitter {jitter:g})"
        )
    found.sort(key=lambda one: one.value)
    return Training(tuple(found), tuple(starts), step, jitter, kernel)


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
    parameters = Parameters.from_vector(x)
    free = _free(x, gradient)
    return Climb(
        parameters,
        value,
        converged,
        iteration,
        evaluations,
        float(gained),
        float(np.abs(gradient[free]).max()),
        likelihood.factor(parameters).condition,
    )


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
