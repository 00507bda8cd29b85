"""Marginal likelihood of the coregionalised process, with its gradient in closed form.

`f_t(x)` of task `t` has covariance `B[t, t'] k(x, x')`; an observation adds noise of variance `s2_t`. With `K` the
covariance of the means of replicates (see `replicates`) and `a = K^-1 m`,

    L = a . m / 2 + log|K| / 2 + n log(2 pi) / 2 + the replicates' own part,     dL/dK = (K^-1 - a a^T) / 2

The second derivatives are replaced by the average information `a^T K_i K^-1 K_j a / 2`, `K_i = dK / dtheta_i`, the mean
of the observed and the expected information where `K` is linear in the parameters (Gilmour, Thompson and Cullis,
Biometrics 51:1440, 1995): positive semidefinite, and of the cost of one solve with 37 right-hand sides.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.errors import SolveError
from warpbrain.gp.kernels import KERNELS
from warpbrain.gp.parameters import TASKS, Parameters
from warpbrain.gp.replicates import Replicates

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Factored:
    """A covariance matrix that was factored.

    Attributes
    ----------
    cholesky : (m, m) array
        Lower triangle.
    weights : (m,) array
        `K^-1` times the observed means.
    condition : float
        Condition number in the 1-norm, as LAPACK estimates it.
    """

    cholesky: Floats
    weights: Floats
    condition: float


class Likelihood:
    """Negative log marginal likelihood of observations as a function of the parameters.

    Parameters
    ----------
    data : Replicates
    kernel : str
        Name in `KERNELS`.
    jitter : float
        Variance added to the diagonal, explicit and reported: none unless asked for.
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

        Raises
        ------
        SolveError
            If it is not positive definite in double precision; a jitter would make it so, and has to be asked for.
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
        own = 0.5 * (data.count - 1) * np.log(2.0 * math.pi * noise) + 0.5 * np.log(data.count)
        own += 0.5 * data.scatter / noise
        log_determinant = 2.0 * float(np.log(np.diag(factored.cholesky)).sum())
        constant = 0.5 * data.size * math.log(2.0 * math.pi)
        return 0.5 * float(data.mean @ factored.weights) + 0.5 * log_determinant + constant + float(own.sum())

    def value_and_gradient(self, parameters: Parameters) -> tuple[float, Floats]:
        """As `value`, with its derivative by the vector of parameters (37,)."""
        return self._derivatives(parameters, self.factor(parameters))

    def value_gradient_and_information(self, parameters: Parameters) -> tuple[float, Floats, Floats]:
        """As `value_and_gradient`, with the average information (37, 37) in the same parameters."""
        factored = self.factor(parameters)
        value, gradient = self._derivatives(parameters, factored)
        return value, gradient, self._information(parameters, factored)

    def _derivatives(self, parameters: Parameters, factored: Factored) -> tuple[float, Floats]:
        from scipy.linalg.lapack import dpotri

        data = self.data
        _, k, dk = self.covariance(parameters)
        inverse, info = dpotri(factored.cholesky, lower=1)
        assert info == 0
        inverse = np.tril(inverse) + np.tril(inverse, -1).T
        G = 0.5 * (inverse - np.outer(factored.weights, factored.weights))
        by_B = self._blocks(G * k)
        by_noise = np.bincount(data.task, weights=np.diag(G) / data.count, minlength=TASKS)
        noise = parameters.noise
        extra = np.bincount(data.task, weights=data.count - 1, minlength=TASKS) / noise
        extra -= self._scatter / noise**2
        B = parameters.coregionalisation[np.ix_(data.task, data.task)]
        gradient = np.concatenate(
            [
                [float(np.sum(G * B * dk))],
                2.0 * by_B @ parameters.w,
                np.diag(by_B) * parameters.kappa,
                (by_noise + 0.5 * extra) * noise,
            ]
        )
        return self._value(parameters, factored), gradient

    def _information(self, parameters: Parameters, factored: Factored) -> Floats:
        from scipy.linalg import solve_triangular

        data, w, a = self.data, parameters.w, factored.weights
        _, k, dk = self.covariance(parameters)
        B = parameters.coregionalisation[np.ix_(data.task, data.task)]
        own = np.zeros((data.size, TASKS))
        own[np.arange(data.size), data.task] = 1.0
        by_task = k @ (own * a[:, None])
        # columns K_i a
        by_w = w[data.task, None] * by_task + own * (by_task @ w)[:, None]
        by_kappa = parameters.kappa * own * by_task
        by_noise = parameters.noise * own * (a / data.count)[:, None]
        columns = np.concatenate([((B * dk) @ a)[:, None], by_w, by_kappa, by_noise], axis=1)
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
