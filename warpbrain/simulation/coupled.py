"""Linear systems with unknowns of a term's own: the pressure of pore fluid beside the displacement.

To eliminate `p` from `A p = -(db/du) d` leaves a dense matrix, `K + w B^T A^-1 B` with `B = db/du`. Both together are
sparse, and symmetric:

    [      K       -sqrt(w) B^T ] [ d ]   [ r ]
    [ -sqrt(w) B        -A      ] [ p ] = [ 0 ]

but indefinite. Of several such terms, as of two fluids in one skeleton, `p` are the unknowns of each in turn: they
meet in the displacement alone, so `A` has a block for each term. Generalised minimal residuals (SciPy's, on the host
whatever the device) are preconditioned by the block triangle (Saad, Iterative Methods for Sparse Linear Systems, 2nd
ed., section 9.4)

    [      K0        0  ]
    [ -sqrt(w) B    -S0 ],    S0 = A + w Y,

`K0` of a state that is near, and `Y` what the term says that the solid gives way to its unknowns (`Coupling.yielding`).

`A` is next to nothing where fluid has no time to flow; what is left of the second row is a force many times larger. So
a solve ends only when the residual of the eliminated system is small.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warpbrain.arrays import Floats
from warpbrain.kernels.linear import LinearResult, LinearSolver
from warpbrain.physics.term import Term
from warpbrain.simulation.factors import KeptFactors, SparseFactors
from warpbrain.threads import one_thread_of_blas

if TYPE_CHECKING:
    from warpbrain.simulation.system import System

#: What is asked of the whole system, relative to what is asked of the solve, in the first place; and how often it may
#: go on.
_FIRST, _ROUNDS = 0.3, 6
#: Iterations at most, with factors of a state nearby and with its own.
_MOST = 120


class CoupledSolver:
    """Solves the system's matrix together with what terms with unknowns of their own add to it.

    `plain` is for times when none of these follow the displacement; the tolerance is relative. The `factors` are kept
    from one solve to the next, and renewed where they do not help.
    """

    def __init__(
        self, system: System, terms: Sequence[Term], plain: LinearSolver, factors: KeptFactors, tolerance: float
    ) -> None:
        self._system, self._plain, self._factors, self._tolerance = system, plain, factors, tolerance
        self._terms, self._free = terms, ~system.model.constrained.ravel()
        self._result: LinearResult | None = None
        self._product = wp.zeros(system.size, dtype=system.precision.vec3, device=system.device)
        #: That of `S0`, and its factors: it changes from step to step, not within one.
        self._schur: tuple[Any, SparseFactors] | None = None

    def multiply(self, x: wp.array, z: wp.array) -> None:
        self._plain.multiply(x, z)

    def prepare(self) -> None:
        from scipy.sparse import block_diag, bsr_matrix, diags, vstack

        if not self._system.coupled:
            self._plain.prepare()
            return
        n, matrix = self._system.size, self._system.matrix
        values = matrix.values.numpy().astype(np.float64, copy=False)
        # constrained rows and columns are those of the identity
        self._K = bsr_matrix((values, matrix.columns.numpy(), matrix.offsets.numpy()), shape=(3 * n, 3 * n))
        self._root = math.sqrt(self._system.coupling_factor)
        coupled = [c for term in self._terms if term.coupled and (c := term.coupling) is not None]
        self._A = block_diag([c.compliance for c in coupled], format="csr")
        self._B = self._root * vstack([c.own for c in coupled], format="csr") @ diags(self._free.astype(np.float64))
        self._BT = self._B.T
        S = self._A + self._root**2 * block_diag([c.yielding for c in coupled], format="csr")
        # a node without an unknown has no row
        S = (S + diags((S.diagonal() == 0.0).astype(np.float64))).tocsc()
        if self._schur is None or not np.array_equal(self._schur[0].data, S.data):
            self._schur = S, SparseFactors(S)
        # both kinds of residual as parts of what their own unknown makes of one unit of energy
        self._weight = 1.0 / np.sqrt(np.abs(np.concatenate([self._K.diagonal(), S.diagonal()])))

    def solve(self, tolerance: float | None = None) -> None:
        """See `LinearSolver`; begins with zero, for a guess of the displacement alone is none for both."""
        self._result = None
        if not self._system.coupled:
            self._plain.solve(tolerance)
            return
        wanted = self._tolerance if tolerance is None else tolerance
        # sums over nodes take less than to wake other threads
        with one_thread_of_blas():
            if self._factors.serve(self._free):
                self._result = self._try(wanted)
            if self._result is None or not (self._result.converged or self._result.indefinite):
                renewed = self._factors.renew(self._K, self._free)
                self._result = self._try(wanted) if renewed else LinearResult(0, np.inf, 0.0, np.nan)

    def result(self) -> LinearResult:
        return self._result or self._plain.result()

    def _try(self, wanted: float) -> LinearResult:
        """Ever closer, until what is left of the eliminated system is at most `wanted` times the load."""
        system, size = self._system, 3 * self._system.size
        b = np.concatenate([system.load.numpy().astype(np.float64).ravel(), np.zeros(self._A.shape[0])])
        x, length = np.zeros_like(b), float(np.linalg.norm(self._weight * b))
        tighter, iterations = _FIRST, 0
        for _ in range(_ROUNDS):
            goal = tighter * wanted * length
            step, taken = self._minimal_residual(b - self._multiply(x), goal, _MOST - iterations)
            x, iterations = x + step, iterations + taken
            system.solution.assign(x[:size].reshape(-1, 3))
            result = self._look(iterations, wanted)
            if result.converged or iterations >= _MOST or not np.isfinite(result.residual):
                break
            # of the whole system less may be left than was asked for, so that no iteration is taken
            tighter *= 0.3 * result.tolerance / result.residual
        self._factors.count(iterations)
        return result

    def _multiply(self, x: Floats) -> Floats:
        """The whole matrix times displacements and unknowns."""
        d, p = np.split(x, [self._K.shape[0]])
        return np.concatenate([self._K @ d - self._BT @ p, -(self._B @ d) - self._A @ p])

    def _precondition(self, r: Floats) -> Floats:
        """What the block triangle makes of a residual."""
        assert self._schur is not None
        of_forces, of_unknowns = np.split(r, [self._K.shape[0]])
        d = self._factors.solve(of_forces)
        return np.concatenate([d, -self._schur[1].solve(of_unknowns + self._B @ d)])

    def _minimal_residual(self, b: Floats, goal: float, most: int) -> tuple[Floats, int]:
        """`x` with `|weight (b - A x)| <= goal` if `most` iterations find it, and how many it took."""
        from scipy.sparse.linalg import LinearOperator, gmres

        weight, taken = self._weight, 0

        def count(_residual: float) -> None:
            nonlocal taken
            taken += 1

        def weighted(y: Floats) -> Floats:
            return weight * self._multiply(self._precondition(y / weight))

        operator = LinearOperator((len(b), len(b)), matvec=weighted, dtype=np.float64)
        y, _ = gmres(
            operator, weight * b, rtol=0.0, atol=goal, restart=most, maxiter=1, callback=count, callback_type="pr_norm"
        )
        return self._precondition(y / weight), taken

    def _look(self, iterations: int, wanted: float) -> LinearResult:
        """The residual of the eliminated system with what is in the solution array, and the curvature along that."""
        s = self._system
        self._plain.multiply(s.solution, self._product)
        s.add_coupling(s.solution, self._root**2, self._product)
        load, product, solution = (array.numpy().astype(np.float64) for array in (s.load, self._product, s.solution))
        along = float(np.vdot(solution, solution))
        curvature = float(np.vdot(solution, product)) / along if along > 0.0 else float("nan")
        residual = float(np.linalg.norm(load - product))
        return LinearResult(iterations, residual, wanted * float(np.linalg.norm(load)), curvature)
