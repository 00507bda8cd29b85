"""Marginal likelihood of the coregionalised process, with its gradient in closed form.

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
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from warpbrain.arrays import Floats, Ints
from warpbrain.errors import InputError, SolveError
from warpbrain.gp.kernels import KERNELS

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
        """The parameters of `to_vector`."""
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
        """How many means there are."""
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
        # rows of one task together, so that sums over tasks are sums over blocks
        self._order = np.argsort(data.task, kind="stable")
        self._starts = np.searchsorted(data.task[self._order], np.arange(TASKS))
        self._present = np.unique(data.task)
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

    def value(self, parameters: Parameters) -> float:
        """Negative log marginal likelihood of all observations."""
        return self._value(parameters, self.factor(parameters))

    def _value(self, parameters: Parameters, factored: Factored) -> float:
        data = self.data
        noise = parameters.noise[data.task]
        of_replicates = 0.5 * (data.count - 1) * np.log(2.0 * math.pi * noise) + 0.5 * np.log(data.count)
        of_replicates += 0.5 * data.scatter / noise
        log_determinant = 2.0 * float(np.log(np.diag(factored.cholesky)).sum())
        constant = 0.5 * data.size * math.log(2.0 * math.pi)
        return 0.5 * float(data.mean @ factored.weights) + 0.5 * log_determinant + constant + float(of_replicates.sum())

    def value_gradient_and_information(self, parameters: Parameters) -> tuple[float, Floats, Floats]:
        """As `value`, with its derivative (37,) and the average information (37, 37) in the vector of parameters."""
        factored = self.factor(parameters)
        _, k, dk = self.covariance(parameters)
        B = parameters.coregionalisation[np.ix_(self.data.task, self.data.task)]
        gradient = self._gradient(parameters, factored, k, B * dk)
        return self._value(parameters, factored), gradient, self._information(parameters, factored, k, B * dk)

    def _gradient(self, parameters: Parameters, factored: Factored, k: Floats, by_length: Floats) -> Floats:
        from scipy.linalg.lapack import dpotri

        data, noise = self.data, parameters.noise
        inverse, info = dpotri(factored.cholesky, lower=1)
        assert info == 0
        inverse = np.tril(inverse) + np.tril(inverse, -1).T
        G = 0.5 * (inverse - np.outer(factored.weights, factored.weights))
        by_B = self._blocks(G * k)
        by_noise = np.bincount(data.task, weights=np.diag(G) / data.count, minlength=TASKS)
        extra = np.bincount(data.task, weights=data.count - 1, minlength=TASKS) / noise - self._scatter / noise**2
        return np.concatenate(
            [
                [float(np.sum(G * by_length))],
                2.0 * by_B @ parameters.w,
                np.diag(by_B) * parameters.kappa,
                (by_noise + 0.5 * extra) * noise,
            ]
        )

    def _information(self, parameters: Parameters, factored: Factored, k: Floats, by_length: Floats) -> Floats:
        from scipy.linalg import solve_triangular

        data, w, a = self.data, parameters.w, factored.weights
        members = np.zeros((data.size, TASKS))
        members[np.arange(data.size), data.task] = 1.0
        by_task = k @ (members * a[:, None])
        # columns K_i a
        by_w = w[data.task, None] * by_task + members * (by_task @ w)[:, None]
        by_kappa = parameters.kappa * members * by_task
        by_noise = parameters.noise * members * (a / data.count)[:, None]
        columns = np.concatenate([(by_length @ a)[:, None], by_w, by_kappa, by_noise], axis=1)
        half = solve_triangular(factored.cholesky, columns, lower=True, check_finite=False)
        information = 0.5 * half.T @ half
        at = np.arange(1 + 2 * TASKS, 1 + 3 * TASKS)
        information[at, at] += 0.5 * self._scatter / parameters.noise
        return information

    def _blocks(self, matrix: Floats) -> Floats:
        """Sums (12, 12) of a matrix (m, m) over pairs of tasks."""
        sums = np.zeros((TASKS, TASKS))
        ordered = matrix[np.ix_(self._order, self._order)]
        at = self._starts[self._present]
        rows = np.add.reduceat(ordered, at, axis=0)
        sums[np.ix_(self._present, self._present)] = np.add.reduceat(rows, at, axis=1)
        return sums
