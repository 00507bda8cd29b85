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
        self._plain = plain
        self._coarse = coarse
        self._prolong, self._restrict = prolongation, prolongation.T.tocsr()
        self._arrays: dict[str, wp.array] = {"b": right_hand_side, "x": solution}
        for name in ("r", "z", "p", "Ap", "left", "step", "changed"):
            self._arrays[name] = wp.zeros_like(right_hand_side)
        # arrays of the CPU are seen by NumPy without a copy
        self._flat = {name: array.numpy().reshape(-1) for name, array in self._arrays.items()}
        self._largest = 0.0
        self._power = np.random.default_rng(0).normal(size=3 * right_hand_side.shape[0])
        self._result: LinearResult | None = None

    def multiply(self, x: wp.array, z: wp.array) -> None:
        """`z = A x`."""
        self._plain.multiply(x, z)

    def prepare(self) -> None:
        """Take notice of new values of the matrix."""
        self._plain.prepare()
        step, left = self._flat["step"], self._flat["left"]
        for _ in range(_FIRST if self._largest == 0.0 else _AGAIN):
            step[:] = self._power / np.linalg.norm(self._power)
            self._product("step", "changed")
            self._diagonal("changed", "left")
            self._largest = float(np.linalg.norm(left))
            self._power[:] = left

    def solve(self, tolerance: float | None = None) -> None:
        """Solve from the present content of the solution array, until ``|b - A x| <= tolerance |b|``."""
        tolerance = self._tolerance if tolerance is None else tolerance
        start = self._flat["x"].copy()
        self._result = self._iterate(tolerance)
        if self._result is None:
            self.slow = True
            self._flat["x"][:] = start
            self._plain.solve(tolerance)
        elif self._result.iterations > _MOST // 4:
            self.slow = True

    def result(self) -> LinearResult:
        """How the last solve ended."""
        return self._plain.result() if self._result is None else self._result

    def _iterate(self, tolerance: float) -> LinearResult | None:
        """Conjugate gradients; None where the plain solver should be asked."""
        x, r = self._flat["x"], self._flat["r"]
        r[:] = self._flat["b"]
        goal = tolerance * float(np.linalg.norm(r))
        if x.any():
            self._product("x", "Ap")
            r -= self._flat["Ap"]

        def multiply(p: Floats) -> Floats:
            self._flat["p"][:] = p
            self._product("p", "Ap")
            return self._flat["Ap"]

        result = host_gradients(multiply, self._cycle, x, r, goal, _MOST)
        return result if result.converged or result.indefinite else None

    def _cycle(self, r: Floats) -> Floats:
        """What the two levels make of a residual."""
        z, left, step = self._flat["z"], self._flat["left"], self._flat["step"]
        z[:] = 0.0
        left[:] = r
        self._smooth()
        self._go()
        step[:] = self._prolong @ self._coarse.solve((self._restrict @ left)[:, None])[:, 0]
        self._go()
        self._smooth()
        z += step
        return z

    def _smooth(self) -> None:
        """Two terms of Chebyshev's iteration (Saad 2003, Iterative Methods for Sparse Linear Systems, algorithm 12.1).

        The second step is left to be taken.
        """
        largest = _MARGIN * self._largest
        middle, half = 0.5 * (1.0 + _SMOOTHED_FROM) * largest, 0.5 * (1.0 - _SMOOTHED_FROM) * largest
        self._diagonal("left", "step")
        step = self._flat["step"]
        step /= middle
        self._go()
        sigma = middle / half
        rho = 1.0 / (2.0 * sigma - 1.0 / sigma)
        self._diagonal("left", "changed")
        step *= rho / sigma
        step += (2.0 * rho / half) * self._flat["changed"]

    def _go(self) -> None:
        """Take the step; what is left of the residual after it."""
        self._flat["z"][:] += self._flat["step"]
        self._product("step", "changed")
        self._flat["left"][:] -= self._flat["changed"]

    def _product(self, x: str, z: str) -> None:
        self._plain.multiply(self._arrays[x], self._arrays[z])

    def _diagonal(self, x: str, z: str) -> None:
        self._plain.precondition(self._arrays[x], self._arrays[z])
