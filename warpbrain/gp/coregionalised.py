"""The paper's process: twelve groups of log energies that share one curve, with noise at every stretch.

Many published curves are sampled on one grid of stretches. A Gaussian process with independent noise sees of `n`
observations of one task at one stretch only their mean and their sum of squares about it: with `y_i = f + e_i`,
`e_i ~ N(0, s2)`,

    prod_i N(y_i; f, s2) = N(mean(y); f, s2 / n) * (2 pi s2)^(-(n - 1) / 2) n^(-1/2) exp(-SS / (2 s2))

so that 7300 observations become some 1500 and nothing is approximated. `f_t(x)` of task `t` has covariance
`B[t, t'] k(x, x')`; an observation adds noise of variance `s2_t`. With `K` the covariance of the means and
`a = K^-1 m`,

    L = a . m / 2 + log|K| / 2 + n log(2 pi) / 2 + the replicates' own part,     dL/dK = (K^-1 - a a^T) / 2

The second derivatives are replaced by the average information `a^T K_i K^-1 K_j a / 2`, `K_i = dK / dtheta_i`, the mean
of the observed and the expected information where `K` is linear in the parameters (Gilmour, Thompson and Cullis,
Biometrics 51:1440, 1995): positive semidefinite, and of the cost of one solve with 37 right-hand sides.

The likelihood has many optima: a group can follow the curve that all share (large `w`) or go its own way (small `w`,
large `kappa`), and no climb leads from one to the other. So, on a thinned set of stretches, which costs seconds, all
groups are taken together first and then each in turn is set apart; the arrangement that ends lowest is climbed from on
all stretches. Each climb takes Levenberg-damped scoring steps with the average information.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.errors import InputError, SolveError
from warpbrain.gp.literature.study import GROUPS, Study, dataset, groups_of, log_energy
from warpbrain.gp.process import KERNELS, Draws, standard_normal

#: Method times anatomy of the published studies: task = 4 * method + anatomy.
TASKS = 12


@dataclass(frozen=True, eq=False)
class Parameters:
    """Length scale of stretch, coregionalisation `B = w w^T + diag(kappa)` and variance of the noise, (12,) each."""

    length_scale: float
    w: Floats
    kappa: Floats
    noise: Floats

    def __post_init__(self) -> None:
        for name in ("w", "kappa", "noise"):
            value = np.asarray(getattr(self, name), dtype=np.float64)
            if value.shape != (TASKS,) or not np.all(np.isfinite(value)):
                raise InputError(f"{name}: expected {TASKS} finite numbers, found shape {value.shape}")
            if name != "w" and np.any(value <= 0.0):
                raise InputError(f"{name}: expected positive numbers, found {value.min():g}")
            object.__setattr__(self, name, value)
        if not (np.isfinite(self.length_scale) and self.length_scale > 0.0):
            raise InputError(f"length scale: expected a positive number, found {self.length_scale}")

    @property
    def coregionalisation(self) -> Floats:
        """`B`, shape (12, 12)."""
        return np.outer(self.w, self.w) + np.diag(self.kappa)

    def to_vector(self) -> Floats:
        """Free numbers for an optimiser, (37,): `w` as it is, the others as logarithms."""
        return np.concatenate([[np.log(self.length_scale)], self.w, np.log(self.kappa), np.log(self.noise)])

    @classmethod
    def from_vector(cls, vector: Floats) -> Parameters:
        w, kappa, noise = np.split(vector[1:], 3)
        return cls(float(np.exp(vector[0])), w, np.exp(kappa), np.exp(noise))


@dataclass(frozen=True, eq=False)
class Replicates:
    """Means (m,) of observations that share task and stretch `x`.

    `count` says how many each is of, `scatter` is the sum of their squared distances from it.
    """

    task: Ints
    x: Floats
    mean: Floats
    count: Ints
    scatter: Floats

    @classmethod
    def of(cls, task: ArrayLike, x: ArrayLike, y: ArrayLike, digits: int = 12) -> Replicates:
        """Reduce observations: task (n,), stretch (n,) and value (n,); stretches that agree to `digits` are one."""
        tasks, (xs, ys) = np.asarray(task, dtype=np.int64), np.asarray([x, y], dtype=np.float64)
        key = np.stack([tasks, np.round(xs, digits)], axis=1)
        _, first, inverse, count = np.unique(key, axis=0, return_index=True, return_inverse=True, return_counts=True)
        inverse = inverse.ravel()
        mean = np.bincount(inverse, weights=ys) / count
        scatter = np.bincount(inverse, weights=(ys - mean[inverse]) ** 2).astype(np.float64)
        return cls(tasks[first], xs[first], mean, count.astype(np.int64), scatter)

    @property
    def size(self) -> int:
        return len(self.x)

    def thinned(self, step: int) -> Replicates:
        """Every `step`-th stretch of each task, from its lowest: a cheap picture of the whole."""
        order = np.lexsort((self.x, self.task))
        place = np.arange(self.size) - np.searchsorted(self.task[order], self.task[order])
        keep = order[place % step == 0]
        return Replicates(self.task[keep], self.x[keep], self.mean[keep], self.count[keep], self.scatter[keep])


@dataclass(frozen=True, eq=False)
class Factored:
    """A covariance `K`."""

    cholesky: Floats  # lower triangle (m, m)
    weights: Floats  # `K^-1` times the observed means (m,)
    condition: float  # in the 1-norm, as LAPACK estimates it


class Likelihood:
    """Negative log marginal likelihood of observations as a function of the parameters.

    `jitter` is a variance added to the diagonal, explicit and reported: none unless asked for.
    """

    def __init__(self, data: Replicates, kernel: str = "matern32", jitter: float = 0.0) -> None:
        self.data, self.kernel, self.jitter = data, kernel, jitter
        self._distance = np.abs(data.x[:, None] - data.x[None, :])
        self._scatter = np.bincount(data.task, weights=data.scatter, minlength=TASKS)

    def covariance(self, parameters: Parameters) -> tuple[Floats, Floats, Floats]:
        """Covariance of the means (m, m), the kernel alone, and its derivative by log length."""
        k, dk = KERNELS[self.kernel](self._distance, parameters.length_scale)
        B = parameters.coregionalisation[np.ix_(self.data.task, self.data.task)]
        total = B * k
        total[np.diag_indices_from(total)] += parameters.noise[self.data.task] / self.data.count + self.jitter
        return total, k, dk

    def factor(self, parameters: Parameters) -> Factored:
        """Factor the covariance of the means.

        `SolveError` if it is not positive definite in double precision; a jitter would make it so, and has to be asked
        for.
        """
        from scipy.linalg import cho_solve, cholesky
        from scipy.linalg.lapack import dpocon

        K = self.covariance(parameters)[0]
        norm = float(np.abs(K).sum(axis=0).max())
        try:
            L = cholesky(K, lower=True, check_finite=False, overwrite_a=True)
        except np.linalg.LinAlgError:
            raise SolveError(
                f"the covariance of {self.data.size} means is not positive definite in double precision (jitter "
                f"{self.jitter:g})"
            ) from None
        weights = cho_solve((L, True), self.data.mean, check_finite=False)
        reciprocal, _ = dpocon(L, norm, uplo="L")
        return Factored(L, weights, 1.0 / float(reciprocal) if reciprocal else float("inf"))

    def value(self, parameters: Parameters, factored: Factored | None = None) -> float:
        """Negative log marginal likelihood of all observations; `factored` is their covariance where it is known."""
        factored = factored or self.factor(parameters)
        data = self.data
        noise = parameters.noise[data.task]
        of_replicates = 0.5 * (data.count - 1) * np.log(2.0 * math.pi * noise) + 0.5 * np.log(data.count)
        of_replicates += 0.5 * data.scatter / noise
        log_determinant = 2.0 * float(np.log(np.diag(factored.cholesky)).sum())
        constant = 0.5 * data.size * math.log(2.0 * math.pi)
        return 0.5 * float(data.mean @ factored.weights) + 0.5 * log_determinant + constant + float(of_replicates.sum())

    def value_gradient_and_information(self, parameters: Parameters) -> tuple[float, Floats, Floats]:
        """As `value`, with its derivative (37,) and the average information (37, 37) in the vector of parameters."""
        from scipy.linalg import solve_triangular
        from scipy.linalg.lapack import dpotri

        factored = self.factor(parameters)
        data, w, noise, a = self.data, parameters.w, parameters.noise, factored.weights
        _, k, dk = self.covariance(parameters)
        by_length = parameters.coregionalisation[np.ix_(data.task, data.task)] * dk
        inverse, info = dpotri(factored.cholesky, lower=1)
        assert info == 0
        inverse = np.tril(inverse) + np.tril(inverse, -1).T
        G = 0.5 * (inverse - np.outer(a, a))
        members = (data.task[:, None] == np.arange(TASKS)).astype(np.float64)
        by_B = members.T @ (G * k) @ members
        by_noise = np.bincount(data.task, weights=np.diag(G) / data.count, minlength=TASKS)
        extra = np.bincount(data.task, weights=data.count - 1, minlength=TASKS) / noise - self._scatter / noise**2
        slopes = [
            np.array([np.sum(G * by_length)]),
            2.0 * by_B @ w,
            np.diag(by_B) * parameters.kappa,
            (by_noise + 0.5 * extra) * noise,
        ]
        by_task = k @ (members * a[:, None])
        # columns K_i a, of the length scale, w, kappa and the noise
        columns = [
            (by_length @ a)[:, None],
            w[data.task, None] * by_task + members * (by_task @ w)[:, None],
            parameters.kappa * members * by_task,
            noise * members * (a / data.count)[:, None],
        ]
        half = solve_triangular(factored.cholesky, np.concatenate(columns, axis=1), lower=True, check_finite=False)
        information = 0.5 * half.T @ half
        at = np.arange(1 + 2 * TASKS, 1 + 3 * TASKS)
        information[at, at] += 0.5 * self._scatter / noise
        return self.value(parameters, factored), np.concatenate(slopes), information


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

    def described(self) -> dict[str, Any]:
        """All but the parameters, for the record of a fit."""
        return {name: value for name, value in vars(self).items() if name != "parameters"}


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
    progress: Callable[[float, str], None] = lambda part, text: None,
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
    return Training(tuple(ended), tuple(starts), step)


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


#: Tasks (n,) and stretches (n,) of places.
_At = tuple[Ints, Floats]
#: Stretches at which draws are drawn; between them they are the mean given these values.
ANCHORS = np.linspace(0.4, 1.8, 141)


@dataclass(frozen=True, eq=False)
class Coregionalised:
    """The coregionalised process of a set of studies (a `warpbrain.gp.process.Process`).

    `jitter` is a variance added to the diagonal of the covariance, `mean_modulus` the shear modulus [Pa] of the
    neo-Hookean energy that is its mean (0 for the paper's mean of zero), `points` how many it learns from of each
    study.
    """

    studies: tuple[Study, ...]
    parameters: Parameters
    variant: str = "as_published"
    kernel: str = "matern32"
    jitter: float = JITTER
    mean_modulus: float = 0.0
    points: int = 100
    folder: Path | None = None
    name = "coregionalised"

    @property
    def groups(self) -> tuple[str, ...]:
        return groups_of(self.studies)

    def log_energy(self, group: str, stretches: ArrayLike) -> tuple[Floats, Floats]:
        """Mean and standard deviation (n,) of `ln(Psi + 1e-4)`, the noise of the group included, as in the paper."""
        l = np.asarray(stretches, dtype=np.float64)
        mean, covariance = self._predict([group], l, l)
        variance = np.diag(covariance) + self.parameters.noise[GROUPS.index(group)]
        return mean, np.sqrt(np.maximum(variance, 0.0))

    def curve(self, group: str, stretches: ArrayLike, k: ArrayLike = 0.0) -> Floats:
        mean, spread = self.log_energy(group, stretches)
        return mean + np.multiply.outer(np.asarray(k, dtype=np.float64), spread)

    def draw(self, groups: Sequence[str], stretches: ArrayLike, number: int | tuple[int, ...], seed: int = 0) -> Floats:
        """Draw `number` of a seed, see `Process`.

        The noise of a group is one number a curve: it stands for what studies differ by, and moves a whole curve as the
        paper's `k` does. Independent noise at every stretch would be no function.
        """
        normal = standard_normal(len(groups) * (1 + len(ANCHORS)), number, seed)
        l = np.asarray(stretches, dtype=np.float64)
        latent = self._draws.at(tuple(groups), l, normal[len(groups) :], self._predict)
        noise = np.sqrt(self.parameters.noise[[GROUPS.index(group) for group in groups]])
        return latent + (noise * normal[: len(groups)])[:, None]

    @cached_property
    def _draws(self) -> Draws:
        return Draws(ANCHORS)

    def level_of(self, studies: Sequence[Study], stretches: Sequence[Floats]) -> tuple[float, float]:
        """Mean and standard deviation of the mean log energy over new studies, each at its own stretches.

        The noise of a group is one number a curve, as in `draw`.
        """
        task = np.concatenate([np.full(len(l), study.task) for study, l in zip(studies, stretches, strict=True)])
        at = task, np.concatenate(stretches)
        weights = np.concatenate([np.full(len(l), 1.0 / len(l) / len(studies)) for l in stretches])
        mean, covariance = self._predict_at(at, at)
        noise = sum(self.parameters.noise[study.task] for study in studies) / len(studies) ** 2
        return float(weights @ mean), float(np.sqrt(max(weights @ covariance @ weights, 0.0) + noise))

    def _predict(self, groups: Sequence[str], at: Floats, other: Floats) -> tuple[Floats, Floats]:
        """Mean of the shared curve at (groups * n,) and covariance with other stretches, given the studies."""
        tasks = np.array([GROUPS.index(group) for group in groups], dtype=np.int64)
        here, there = ((np.repeat(tasks, len(l)), np.tile(l, len(tasks))) for l in (at, other))
        return self._predict_at(here, here if other is at else there)

    def _predict_at(self, here: _At, there: _At) -> tuple[Floats, Floats]:
        """The same at any pairs of task and stretch."""
        from scipy.linalg import solve_triangular

        data, factored = self._seen
        k = self._covariance((data.task, data.x), here)
        mean = prior_mean(here[1], self.mean_modulus) + k.T @ factored.weights
        whitened = to = solve_triangular(factored.cholesky, k, lower=True)
        if there is not here:
            to = solve_triangular(factored.cholesky, self._covariance((data.task, data.x), there), lower=True)
        return mean, self._covariance(here, there) - whitened.T @ to

    def _covariance(self, a: _At, b: _At) -> Floats:
        distance = np.abs(a[1][:, None] - b[1][None, :])
        k = KERNELS[self.kernel](distance, self.parameters.length_scale)[0]
        return self.parameters.coregionalisation[np.ix_(a[0], b[0])] * k

    @cached_property
    def _seen(self) -> tuple[Replicates, Factored]:
        data = training_points(self.studies, self.mean_modulus, self.points)
        return data, Likelihood(data, self.kernel, self.jitter).factor(self.parameters)


def training_points(studies: Sequence[Study], mean_modulus: float = 0.0, count: int = 100) -> Replicates:
    """What the process learns from: `count` log energies of each study minus their prior mean, replicates reduced."""
    task, stretch, log_energies = dataset(studies, count)
    return Replicates.of(task, stretch, log_energies - prior_mean(stretch, mean_modulus))


def prior_mean(stretches: Floats, modulus: float) -> Floats:
    """Log energy (n,) of a neo-Hookean solid of a shear modulus [Pa], or zero for none."""
    return log_energy(stretches, np.log(modulus)) if modulus else np.zeros_like(stretches)
