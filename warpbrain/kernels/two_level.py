"""Conjugate gradients on a mesh that refines another one, whose tangent is factorised: on the CPU.

What block-Jacobi leaves for hundreds of iterations is smooth, and the coarser mesh knows it. The preconditioner is a
multigrid cycle of two levels (Hackbusch 1985, Multi-Grid Methods and Applications, section 2.4): smooth, put right on
the coarser mesh, smooth again. Smoothing is a Chebyshev polynomial of the second degree in `D^-1 A`, `D` the diagonal
blocks (Adams, Brezina, Hu and Tuminaro 2003, J. Comput. Phys. 188, 593), the same before and after, so that the cycle
is symmetric. It is positive definite as long as no eigenvalue of `D^-1 A` is above nine eighths of what the polynomial
is made for; that is a tenth above an estimate by power iterations. Where that fails, or factors of another state are of
no help, the plain solver is asked.

A cycle multiplies four times with the matrix and solves once with the factors: worth it on one core, where an iteration
takes as long as there are numbers in the matrix. A GPU has done its hundreds of iterations sooner.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
import warp as wp

from warpbrain.arrays import Floats
from warpbrain.kernels.linear import ConjugateGradient, LinearResult, host_gradients

#: Eigenvalues that are smoothed: from this part of the largest one.
_SMOOTHED_FROM = 0.125
#: The largest eigenvalue as a multiple of its estimate, and power iterations of the first estimate and of later ones.
_MARGIN, _FIRST, _AGAIN = 1.1, 15, 3
#: Iterations before the plain solver is asked instead.
_MOST = 100


class CoarseSolver(Protocol):
    """What solves on the coarser mesh."""

    def solve(self, columns: Any) -> Floats:
        """Displacements (k, 1) of its free components under forces (k, 1)."""


class TwoLevelGradient:
    """Solves as the `plain` `ConjugateGradient` does, in fewer iterations.

    `plain` is of the finer mesh, on the CPU, in double precision, preconditioned by diagonal blocks; right-hand side
    and solution are its own. `prolongation`, SciPy CSR (3 n, k), goes from free components of the coarser mesh to those
    of the finer one; rows of constrained ones are zero.

    Attributes
    ----------
    slow : bool
        A solve was given up, or took many iterations: the factors are of too different a state.
    """

    def __init__(
        self,
        plain: ConjugateGradient,
        right_hand_side: wp.array,
        solution: wp.array,
        coarse: CoarseSolver,
        prolongation: Any,
        *,
        tolerance: float,
    ) -> None:
        self.slow = False
        self._tolerance = tolerance
        self._plain, self._coarse = plain, coarse
        self._prolong, self._restrict = prolongation, prolongation.T.tocsr()
        self._given, self._made = wp.zeros_like(right_hand_side), wp.zeros_like(right_hand_side)
        # arrays of the CPU are seen by NumPy without a copy
        arrays = (right_hand_side, solution, self._given, self._made)
        self._b, self._x, self._in, self._out = (array.numpy().reshape(-1) for array in arrays)
        self._largest = 0.0
        self._power = np.random.default_rng(0).normal(size=3 * right_hand_side.shape[0])
        self._result: LinearResult | None = None

    def multiply(self, x: wp.array, z: wp.array) -> None:
        """`z = A x`."""
        self._plain.multiply(x, z)

    def prepare(self) -> None:
        """Take notice of new values of the matrix."""
        self._plain.prepare()
        for _ in range(_FIRST if self._largest == 0.0 else _AGAIN):
            self._power = self._over_diagonal(self._times_matrix(self._power / np.linalg.norm(self._power))).copy()
            self._largest = float(np.linalg.norm(self._power))

    def solve(self, tolerance: float | None = None) -> None:
        """Solve from the present content of the solution array, until ``|b - A x| <= tolerance |b|``."""
        tolerance = self._tolerance if tolerance is None else tolerance
        start, r = self._x.copy(), self._b.copy()
        goal = tolerance * float(np.linalg.norm(r))
        if start.any():
            r -= self._times_matrix(start)
        self._result = host_gradients(self._times_matrix, self._cycle, self._x, r, goal, _MOST)
        self.slow = self.slow or self._result.iterations > _MOST // 4
        if not (self._result.converged or self._result.indefinite):
            self._result, self.slow = None, True
            self._x[:] = start
            self._plain.solve(tolerance)

    def result(self) -> LinearResult:
        """How the last solve ended."""
        return self._plain.result() if self._result is None else self._result

    def _cycle(self, r: Floats) -> Floats:
        """What the two levels make of a residual."""
        z, residual = np.zeros_like(r), r.copy()

        def go(step: Floats) -> None:
            """Take a step; what is left of the residual after it."""
            z[:] += step
            residual[:] -= self._times_matrix(step)

        go(self._smooth(residual, go))
        go(self._prolong @ self._coarse.solve((self._restrict @ residual)[:, None])[:, 0])
        return z + self._smooth(residual, go)

    def _smooth(self, residual: Floats, go: Callable[[Floats], None]) -> Floats:
        """Two terms of Chebyshev's iteration (Saad 2003, Iterative Methods for Sparse Linear Systems, algorithm 12.1).

        The second step is left to be taken.
        """
        largest = _MARGIN * self._largest
        middle, half = 0.5 * (1.0 + _SMOOTHED_FROM) * largest, 0.5 * (1.0 - _SMOOTHED_FROM) * largest
        step = self._over_diagonal(residual) / middle
        go(step)
        sigma = middle / half
        rho = 1.0 / (2.0 * sigma - 1.0 / sigma)
        return rho / sigma * step + (2.0 * rho / half) * self._over_diagonal(residual)

    def _times_matrix(self, x: Floats) -> Floats:
        """`A x`, until the next product."""
        self._in[:] = x
        self._plain.multiply(self._given, self._made)
        return self._out

    def _over_diagonal(self, x: Floats) -> Floats:
        """`D^-1 x`, likewise."""
        self._in[:] = x
        self._plain.precondition(self._given, self._made)
        return self._out
