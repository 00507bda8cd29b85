"""Linear systems solved on the host, preconditioned by the factors of a state that is near.

On the CPU one solve with factors takes as long as some ten iterations of the captured loops of `warpbrain.kernels`.
Where many states follow each other three to six of them do what takes conjugate gradients 50 to 200 iterations, and
MINRES 50 to 1,500: a step in time, another moment, a trial of a fit each changes a tangent a little. On a GPU:
`warpbrain.simulation.kept_inverse`.

Where fluid has a pressure beside the displacement the matrix, that of `warpbrain.simulation.coupled`, is indefinite.
Flexible generalised minimal residuals (Saad, Iterative Methods for Sparse Linear Systems, 2nd ed., section 9.4) are
preconditioned by the block triangle

    [      K0        0  ]
    [ -sqrt(w) B    -S0 ],    S0 = A + w Y,

`K0` of a state that is near, and `Y` what the term says that the solid gives way to its unknowns (`Coupling.yielding`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpbrain.arrays import Floats
from warpbrain.kernels.linear import LinearResult, LinearSolver, host_gradients
from warpbrain.simulation.coupled import CoupledSolver
from warpbrain.simulation.sparse_factors import SparseFactors

if TYPE_CHECKING:
    from warpbrain.simulation.system import System


#: Iterations of a solve with factors that are near.
_NEAR = 5


class KeptFactors:
    """Of the stiffness of the last state that they were renewed at; of none at first."""

    #: How many iterations beyond these a factorisation takes as long as.
    _worth = 25

    def __init__(self) -> None:
        self._free: NDArray[np.bool_] | None = None
        self._factors: Any = None
        self._definite = False
        self._wasted = 0

    def serve(self, free: NDArray[np.bool_], definite: bool) -> bool:
        """Whether there are any for these free components (3 n,), near enough to be worth keeping.

        And positive definite, if they have to be.
        """
        # with factors of an unstable state conjugate gradients could not tell that it is one
        if self._free is None or self._wasted > self._worth or (definite and not self._definite):
            return False
        return np.array_equal(self._free, free)

    def count(self, iterations: int) -> None:
        """Take notice of how many iterations a solve took with them."""
        self._wasted += max(iterations - _NEAR, 0)

    def renew(self, stiffness: Any, free: NDArray[np.bool_], definite: bool) -> bool:
        """Factorise a stiffness [N/m], SciPy (3 n, 3 n), on its free components (3 n,); whether the factors serve."""
        self._free, self._wasted = None, 0
        try:
            self._factors = SparseFactors(stiffness.tocsr()[free][:, free])
        except RuntimeError:
            return False
        self._free, self._definite = free.copy(), self._factors.is_definite
        return self.serve(free, definite)

    def solve(self, forces: Floats) -> Floats:
        """What nodal forces (3 n,) [N] move: (3 n,) [m], zero where components are not free."""
        assert self._free is not None
        displacement = np.zeros(len(forces))
        displacement[self._free] = self._factors.solve(forces[self._free])
        return displacement


#: Iterations after which factors are of no use, and with new ones the captured loop takes over.
MOST = 60


class FactoredSolver:
    """Solves a system's linear systems on the CPU, to a relative tolerance, with factors that are kept from one to the
    next.

    These are made, and made anew, as needed; `captured` takes over where they do not help.
    """

    def __init__(self, system: System, captured: LinearSolver, factors: KeptFactors, tolerance: float) -> None:
        self._system, self._captured, self._factors, self._tolerance = system, captured, factors, tolerance
        self._free = ~system.model.constrained.ravel()
        self._K: Any = None
        self._block: CoupledBlock | None = None
        self._result: LinearResult | None = None

    def multiply(self, x: wp.array, z: wp.array) -> None:
        self._captured.multiply(x, z)

    def prepare(self) -> None:
        from scipy.sparse import bsr_matrix

        self._captured.prepare()
        matrix, size = self._system.matrix, 3 * self._system.size
        values = matrix.values.numpy().astype(np.float64, copy=False)
        self._K = bsr_matrix((values, matrix.columns.numpy(), matrix.offsets.numpy()), shape=(size, size))
        before, self._block = self._block, None
        if isinstance(self._captured, CoupledSolver) and self._system.coupled:
            self._block = CoupledBlock(self._system, self._captured, self._K, self._free, before)

    def solve(self, tolerance: float | None = None) -> None:
        """See `LinearSolver`; begins with zero."""
        wanted = self._tolerance if tolerance is None else tolerance
        # fluid that is pressed at once lends tissue a stiffness that is none without it: then `K` alone is no sign
        definite = self._block is None
        for attempt in range(2):
            renews = attempt == 1 or not self._factors.serve(self._free, definite)
            if renews and not self._factors.renew(self._K, self._free, definite):
                break
            self._result = self._try(wanted)
            self._factors.count(self._result.iterations)
            if self._result.converged or self._result.indefinite:
                return
            if renews:
                break
        self._result = None
        self._system.solution.zero_()
        self._captured.solve(tolerance)

    def _try(self, wanted: float) -> LinearResult:
        load = self._system.load.numpy().astype(np.float64).ravel()
        if self._block is not None:
            return self._block.solve(load, wanted, self._factors, MOST)
        x, residual = np.zeros_like(load), load.copy()
        goal = wanted * float(np.linalg.norm(load))
        result = host_gradients(lambda p: self._K @ p, self._factors.solve, x, residual, goal, MOST)
        self._system.solution.assign(x.reshape(-1, 3))
        return result

    def result(self) -> LinearResult:
        return self._result or self._captured.result()


class CoupledBlock:
    """The system's matrix with the unknowns of terms of their own, on the host.

    `K` is what is in blocks [N/m], SciPy BSR (3 n, 3 n), constrained rows and columns replaced by the identity, and
    `free` (3 n,) says which are not. Of the matrix `before` the factors of `S0` are taken if that is still the same.
    """

    def __init__(
        self, system: System, captured: CoupledSolver, K: Any, free: NDArray[np.bool_], before: CoupledBlock | None
    ) -> None:
        from scipy.sparse import block_diag, csr_matrix, diags, vstack

        self._system, self._captured, self._K = system, captured, K
        self._root = float(system.coupling_root.numpy()[0])
        n, parts = system.size, []
        for c in captured.couplings:
            offsets, columns = c.offsets.numpy(), c.columns.numpy()
            components = (3 * columns[:, None] + np.arange(3)).ravel()
            coupling = self._root * c.own.numpy().astype(np.float64).ravel() * free[components]
            A, Y = (
                csr_matrix((values.numpy().astype(np.float64), columns, offsets), shape=(n, n))
                for values in (c.compliance, c.yielding)
            )
            parts.append((A, csr_matrix((coupling, components, 3 * offsets), shape=(n, 3 * n)), Y))
        compliances, couplings, yielding = zip(*parts, strict=True)
        self._A = block_diag(compliances, format="csr")
        self._B = vstack(couplings, format="csr")
        self._BT = self._B.T
        S = self._A + self._root**2 * block_diag(yielding, format="csr")
        # a node without an unknown has no row
        self._S = (S + diags((S.diagonal() == 0.0).astype(np.float64))).tocsc()
        # it changes from step to step, not within one
        if before is not None and np.array_equal(before._S.data, self._S.data):
            self._schur: SparseFactors = before._schur
        else:
            self._schur = SparseFactors(self._S)

    def solve(self, load: Floats, wanted: float, factors: KeptFactors, most: int) -> LinearResult:
        """Leave the displacement under a load (3 n,) [N], zero on constrained components, in the system's solution.

        Until the residual of the system without pressures is `wanted` times the load, or after `most` iterations, with
        factors of a `K` that is near; returns how that ended.
        """
        size = len(load)

        def operator(x: Floats) -> Floats:
            d, p = x[:size], x[size:]
            return np.concatenate([self._K @ d - self._BT @ p, -(self._B @ d) - self._A @ p])

        def preconditioner(r: Floats) -> Floats:
            d = factors.solve(r[:size])
            return np.concatenate([d, -self._schur.solve(r[size:] + self._B @ d)])

        # both kinds of residual as parts of what their own unknown makes of one unit of energy
        weight = 1.0 / np.sqrt(np.abs(np.concatenate([self._K.diagonal(), self._S.diagonal()])))
        b = np.concatenate([load, np.zeros(self._A.shape[0])])
        x, length = np.zeros_like(b), float(np.linalg.norm(weight * b))

        def go_on(tolerance: float, done: int) -> int:
            nonlocal x
            if done >= most:
                return 0
            residual = b - operator(x)
            more, taken = _minimal_residual(operator, preconditioner, residual, weight, tolerance * length, most - done)
            x = x + more
            self._system.solution.assign(x[:size].reshape(-1, 3))
            return taken

        return self._captured.in_rounds(go_on, wanted)


def _minimal_residual(
    operator: Any, preconditioner: Any, b: Floats, weight: Floats, goal: float, most: int
) -> tuple[Floats, int]:
    """`x` with `|weight (b - A x)| <= goal` if `most` iterations find it, and how many it took."""
    length = float(np.linalg.norm(weight * b))
    if not length > goal:
        return np.zeros_like(b), 0
    basis, moved = [weight * b / length], []
    H = np.zeros((most + 1, most))
    answer = np.zeros(0)
    for k in range(most):
        moved.append(preconditioner(basis[k] / weight))
        v = weight * operator(moved[k])
        for i, vector in enumerate(basis):
            H[i, k] = vector @ v
            v -= H[i, k] * vector
        H[k + 1, k] = np.linalg.norm(v)
        begin = length * np.eye(1, k + 2)[0]
        answer = np.linalg.lstsq(H[: k + 2, : k + 1], begin, rcond=None)[0]
        residual = float(np.linalg.norm(begin - H[: k + 2, : k + 1] @ answer))
        if not residual > goal or H[k + 1, k] == 0.0:
            break
        basis.append(v / H[k + 1, k])
    return np.asarray(answer @ np.array(moved)), len(moved)
