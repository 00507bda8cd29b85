"""How probable residuals are under what may have caused them: normal distributions, marginalised in closed form.

    r = mean + columns z + U xi + kappa L eps,    z, xi, eps ~ N(0, I)

`L` is the factor of the noise, `U` the nuisances times their standard deviations: stiffness, registration, mesh. What
they can explain is worth nothing to a cause. `kappa` is a factor on the noise that nobody knows exactly: everything is
averaged over a grid of it.

With `W = L^-1 U = Q sqrt(D) V^T` the matrix to invert is diagonal for every `kappa`, so a cause costs a few products of
the size of the nuisances, not of the sensors.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from warpbrain.threads import fill_columns
from warpbrain.worlds.body.effects import Effect

Floats = NDArray[np.float64]

#: Factors on the noise, and the scale of their logarithm.
KAPPAS = np.array([0.65, 0.78, 0.9, 1.0, 1.12, 1.28, 1.5, 1.9, 2.5, 3.5])
KAPPA_SD = 0.2
#: Columns that one thread whitens.
_TOGETHER = 256


def kappa_log_prior(kappas: Floats = KAPPAS, sd: float = KAPPA_SD) -> Floats:
    """Logarithm of the weight of each factor: a Student t of three degrees of freedom in `ln kappa`."""
    from scipy.special import logsumexp

    found = -2.0 * np.log1p((np.log(kappas) / sd) ** 2 / 3.0)
    return np.asarray(found - logsumexp(found))


def log_mean(logs: Floats) -> Floats:
    """Logarithm of the mean over the first axis of what these are the logarithms of."""
    from scipy.special import logsumexp

    return np.asarray(logsumexp(logs, axis=0) - np.log(len(logs)))


@dataclass(frozen=True, eq=False)
class Stack:
    """Effects side by side, whitened: columns of each (its mean first), and which are whose.

    Attributes
    ----------
    columns : (n, K) array
        Whitened by the noise.
    first : (v + 1,) int array
        Where the columns of each effect begin.
    """

    columns: Floats
    first: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.first) - 1

    def of(self, number: int) -> Floats:
        """Columns of one effect, its mean first."""
        return self.columns[:, self.first[number] : self.first[number + 1]]

    def some(self, numbers: NDArray[np.int64]) -> Stack:
        """Some of the effects, in that order."""
        each = [self.of(number) for number in numbers.tolist()]
        return Stack(np.concatenate(each, axis=1), np.cumsum([0, *(columns.shape[1] for columns in each)]))


class Explanation:
    """What residuals are compared with: noise, and nuisances that may explain them first.

    Parameters
    ----------
    factor : (n, n) array
        `L`, lower triangular.
    nuisances : (n, q) array
        `U`.
    """

    def __init__(self, factor: Floats, nuisances: Floats) -> None:
        self.factor = factor
        self.nuisances = nuisances
        self._factorise(self.whitened(nuisances))

    def _factorise(self, whitened: Floats) -> None:
        """Take whitened nuisances (n, q)."""
        self._W = whitened
        values, vectors = np.linalg.eigh(whitened.T @ whitened)
        self._D: Floats = np.maximum(values, 0.0)
        self._WV = whitened @ vectors
        self._log_det = 2.0 * float(np.log(np.diag(self.factor)).sum())
        # what is known of the noise alone stays known
        self.__dict__.pop("_of_inverse", None)

    def whitened(self, rows: Floats) -> Floats:
        """`L^-1` of rows (n,) or (n, k): of many some at a time, in threads."""
        from scipy.linalg import solve_triangular

        if rows.ndim == 1 or rows.shape[1] <= _TOGETHER:
            return np.asarray(solve_triangular(self.factor, rows, lower=True, check_finite=False))
        found = np.empty(rows.shape, order="F")
        fill_columns(
            found, lambda some: solve_triangular(self.factor, rows[:, some], lower=True, check_finite=False), _TOGETHER
        )
        return found

    def with_more(self, nuisances: Floats) -> Explanation:
        """The same with more nuisances (n, p)."""
        found = copy.copy(self)
        found.nuisances = np.concatenate([self.nuisances, nuisances], axis=1)
        found._factorise(np.concatenate([self._W, self.whitened(nuisances)], axis=1))
        return found

    def with_noise(self, rows: NDArray[np.bool_], times: float) -> Explanation:
        """The same with the noise of some rows (n,) so many times as large, what they share with others included."""
        found = copy.copy(self)
        found.factor = np.where(rows, times, 1.0)[:, None] * self.factor
        found.__dict__.pop("_inverse_factor", None)
        found._factorise(self.whitened_anew(self._W, rows, times))
        return found

    def whitened_anew(self, whitened: Floats, rows: NDArray[np.bool_], times: float) -> Floats:
        """What is whitened (n, k), whitened by the noise of `with_noise` instead.

        With `D` the diagonal of the factors on the noise, `(D L)^-1 = L^-1 + L^-1 (D^-1 - I)`: of as many columns of
        `L^-1` as there are such rows.
        """
        own = self.whitened(np.eye(self.size)[:, rows])
        return np.asarray(whitened + (1.0 / times - 1.0) * (own @ (self.factor[rows] @ whitened)))

    @property
    def size(self) -> int:
        """Sensors."""
        return len(self.factor)

    def stack(self, effects: Sequence[Effect]) -> Stack:
        """Whiten effects."""
        return self._stacked([np.column_stack([effect.mean, effect.columns]) for effect in effects])

    def stack_of_forces(self, forces: Sequence[Floats]) -> Stack:
        """The same of columns (n, k) each, whose mean is zero."""
        return self._stacked([np.column_stack([np.zeros(self.size), columns]) for columns in forces])

    def _stacked(self, each: Sequence[Floats]) -> Stack:
        if not each:
            return Stack(np.zeros((self.size, 0)), np.zeros(1, dtype=np.int64))
        first = np.cumsum([0, *(columns.shape[1] for columns in each)])
        return Stack(self.whitened(np.concatenate(each, axis=1)), first)

    def log_none(self, residuals: Floats, kappas: Floats = KAPPAS) -> Floats:
        """Log density of whitened residuals (n, b) without any cause: (kappas, b)."""
        rr, Vr = np.sum(residuals**2, axis=0), self.seen_by_nuisances(residuals)
        return np.array([self._log_base(rr, Vr, k) for k in kappas])

    def log_marginal(self, residuals: Floats, kappas: Floats = KAPPAS) -> Floats:
        """The same averaged over the factor on the noise: (b,)."""
        from scipy.special import logsumexp

        return np.asarray(logsumexp(self.log_none(residuals, kappas) + kappa_log_prior(kappas)[:, None], axis=0))

    def _log_base(self, rr: Floats, Vr: Floats, kappa: float) -> Floats:
        k2 = kappa**2
        quadratic = (rr - np.sum(Vr**2 / (k2 + self._D)[:, None], axis=0)) / k2
        log_det = self.size * np.log(k2) + float(np.log1p(self._D / k2).sum()) + self._log_det
        return np.asarray(-0.5 * (quadratic + log_det + self.size * np.log(2.0 * np.pi)))

    @property
    def sizes(self) -> Floats:
        """`D` (q,): variances of what nuisances do, along orthogonal directions."""
        return self._D

    def seen_by_nuisances(self, rows: Floats) -> Floats:
        """Products (q, b) of whitened rows (n, b) with what nuisances do along each of these directions."""
        return np.asarray(self._WV.T @ rows)

    def precision_times(self, rows: Floats, kappa: float = 1.0) -> Floats:
        """`S^-1` of whitened rows (n, b): what is left of them after noise and nuisances, whitened."""
        k2 = kappa**2
        return np.asarray((rows - self._WV @ (self.seen_by_nuisances(rows) / (k2 + self._D)[:, None])) / k2)

    def inverse_times(self, residual: Floats, kappa: float) -> Floats:
        """`C^-1 r` of a residual (n,) that is not whitened, with `C = kappa^2 L L^T + U U^T`."""
        return np.asarray(self._inverse_factor.T @ self.precision_times(self.whitened(residual)[:, None], kappa)[:, 0])

    def inverse_blocks(self, rows: NDArray[np.int64], kappa: float) -> Floats:
        """Blocks (g, s, s) of `C^-1` that belong to rows (g, s)."""
        A, B = self._inverse_factor[:, rows], self._of_inverse[:, rows]
        weighted = B / (kappa**2 + self._D)[:, None, None]
        return np.asarray((np.einsum("ngi,ngj->gij", A, A) - np.einsum("qgi,qgj->gij", weighted, B)) / kappa**2)

    @cached_property
    def _inverse_factor(self) -> Floats:
        return self.whitened(np.eye(self.size))

    @cached_property
    def _of_inverse(self) -> Floats:
        return self.seen_by_nuisances(self._inverse_factor)

    def standardised(self, rows: Floats, kappa: float) -> Floats:
        """`S^-1/2` of whitened rows (n, b): independent and of variance one where nothing is missing."""
        root = np.sqrt(kappa**2 + self._D)
        return np.asarray((rows - self._WV @ (self.seen_by_nuisances(rows) / (root * (root + kappa))[:, None])) / kappa)

    def detectability(self, whitened: Floats, kappa: float = 1.0) -> float:
        """`d = sqrt(delta^T S^-1 delta)` of a change of the sensors (n,), whitened."""
        square = float(whitened @ self.precision_times(whitened[:, None], kappa)[:, 0])
        return max(square, 0.0) ** 0.5

    def best_kappa(self, whitened: Floats) -> float:
        """Mean of the factor on the noise after residuals (n,), whitened."""
        from scipy.special import softmax

        weights = softmax(self.log_none(whitened[:, None])[:, 0] + kappa_log_prior())
        return float(weights @ KAPPAS)

    def nuisances_given(self, whitened: Floats, kappa: float) -> Floats:
        """Mean of the nuisances `xi` (q,) after residuals (n,), whitened."""
        return np.asarray(self._W.T @ self.precision_times(whitened[:, None], kappa)[:, 0])

    def draws(self, count: int, kappa: float, rng: np.random.Generator) -> Floats:
        """Whitened residuals (n, count) of which nothing but noise and nuisances is the cause."""
        noise = kappa * rng.normal(size=(self.size, count))
        return np.asarray(noise + self._W @ rng.normal(size=(self._W.shape[1], count)))
