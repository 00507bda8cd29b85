"""Linear systems solved on the host, preconditioned by the factors of a state that is near.

On the CPU one solve with factors takes as long as some ten iterations of the captured loops of `warpbrain.kernels`.
Where many states follow each other three to six of them do what takes conjugate gradients 50 to 200 iterations, and
MINRES 50 to 1,500. With pressures of fluid beside the displacement (`warpbrain.simulation.coupled`) the matrix is
indefinite, and flexible generalised minimal residuals (Saad, Iterative Methods for Sparse Linear Systems, 2nd ed.,
section 9.4) are preconditioned by the block triangle

    [      K0        0  ]
    [ -sqrt(w) B    -S0 ],    S0 = A + w Y,

`Y` what the term says that the solid gives way to its unknowns (`Coupling.yielding`). On a GPU the captured loops stay,
which never leave it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpbrain.kernels.linear import LinearResult
from warpbrain.simulation.coupled import FIRST, ROUNDS, CoupledSolver, LinearSolver
from warpbrain.simulation.factors import Factors

if TYPE_CHECKING:
    from warpbrain.simulation.system import System

Floats = NDArray[np.float64]

#: Iterations after which factors are of no use, and with new ones the captured loop takes over.
_MOST = 60


class FactoredSolver:
    """Solves a system's linear systems with factors that are kept from one to the next.

    Parameters
    ----------
    system : System
        On the CPU.
    captured : LinearSolver
        Of that system: takes over where factors do not help.
    factors : Factors
        Made, and made anew, as needed.
    tolerance : float
        Relative.
    """

    def __init__(self, system: System, captured: LinearSolver, factors: Factors, tolerance: float) -> None:
        self._system, self._captured, self._factors, self._tolerance = system, captured, factors, tolerance
        self._free = ~system.model.constrained.ravel()
        self._K: Any = None
        self._block: _Block | None = None
        self._result: LinearResult | None = None

    def multiply(self, x: wp.array, z: wp.array) -> None:
        """See `LinearSolver`."""
        self._captured.multiply(x, z)

    def prepare(self) -> None:
        """See `LinearSolver`."""
        from scipy.sparse import bsr_matrix

        self._captured.prepare()
        matrix, size = self._system.matrix, 3 * self._system.size
        values = matrix.values.numpy().astype(np.float64, copy=False)
        self._K = bsr_matrix((values, matrix.columns.numpy(), matrix.offsets.numpy()), shape=(size, size))
        coupled = isinstance(self._captured, CoupledSolver) and self._system.coupled
        before = self._block
        self._block = _Block(self._system, self._captured, self._K, self._free, before) if coupled else None

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
            return self._block.solve(load, wanted, self._factors)
        x, result = self._conjugate_gradients(load, wanted)
        self._system.solution.assign(x.reshape(-1, 3))
        return result

    def _conjugate_gradients(self, b: Floats, wanted: float) -> tuple[Floats, LinearResult]:
        x, r = np.zeros_like(b), b.copy()
        goal, least, before = wanted * float(np.linalg.norm(b)), np.inf, 1.0
        p = np.zeros_like(b)
        for iteration in range(_MOST + 1):
            left = float(np.linalg.norm(r))
            if not left > goal or iteration == _MOST:
                break
            z = self._factors.solve(r)
            along = float(r @ z)
            p = z + along / before * p
            Kp = self._K @ p
            curvature = float(p @ Kp)
            least = min(least, curvature / float(p @ p))
            if not curvature > 0.0:
                break
            x += along / curvature * p
            r -= along / curvature * Kp
            before = along
        return x, LinearResult(iteration, left, goal, least if np.isfinite(least) else float("nan"))

    def result(self) -> LinearResult:
        """See `LinearSolver`."""
        return self._result or self._captured.result()


class _Block:
    """The matrix with a term's own unknowns, on the host."""

    def __init__(
        self, system: System, captured: LinearSolver, K: Any, free: NDArray[np.bool_], before: _Block | None
    ) -> None:
        from scipy.sparse import csr_matrix, diags
        from scipy.sparse.linalg import splu

        assert isinstance(captured, CoupledSolver)
        self._system, self._captured, self._K = system, captured, K
        self._root = float(system.coupling_root.numpy()[0])
        n, c = system.size, captured.coupling
        offsets, columns = c.offsets.numpy(), c.columns.numpy()
        self._A = csr_matrix((c.compliance.numpy().astype(np.float64), columns, offsets), shape=(n, n))
        components = (3 * columns[:, None] + np.arange(3)).ravel()
        own = self._root * c.own.numpy().astype(np.float64).ravel() * free[components]
        self._B = csr_matrix((own, components, 3 * offsets), shape=(n, 3 * n))
        self._BT = self._B.T
        Y = csr_matrix((c.yielding.numpy().astype(np.float64), columns, offsets), shape=(n, n))
        S = self._A + self._root**2 * Y
        # a node without an unknown has no row
        self._S = (S + diags((S.diagonal() == 0.0).astype(np.float64))).tocsc()
        # it changes from step to step, not within one
        if before is not None and np.array_equal(before._S.data, self._S.data):
            self._schur: Any = before._schur
        else:
            options = {"SymmetricMode": True}
            self._schur = splu(self._S, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)

    def solve(self, load: Floats, wanted: float, factors: Factors) -> LinearResult:
        """Leave the displacement under a load (3 n,) in the system's solution; how that ended."""
        size = len(load)

        def operator(x: Floats) -> Floats:
            d, p = x[:size], x[size:]
            return np.concatenate([self._K @ d - self._BT @ p, -(self._B @ d) - self._A @ p])

        def preconditioner(r: Floats) -> Floats:
            d = factors.solve(r[:size])
            return np.concatenate([d, -self._schur.solve(r[size:] + self._B @ d)])

        # both kinds of residual as parts of what their own unknown makes of one unit of energy
        weight = 1.0 / np.sqrt(np.abs(np.concatenate([self._K.diagonal(), self._S.diagonal()])))
        b = np.concatenate([load, np.zeros(self._system.size)])
        x, tighter, iterations = np.zeros_like(b), FIRST, 0
        for _ in range(ROUNDS):
            more, steps = _minimal_residual(
                operator, preconditioner, b - operator(x), weight,
                tighter * wanted * float(np.linalg.norm(weight * b)), _MOST - iterations,
            )  # fmt: skip
            x, iterations = x + more, iterations + steps
            self._system.solution.assign(x[:size].reshape(-1, 3))
            result = self._captured.look(iterations, wanted)
            if result.converged or steps == 0 or iterations >= _MOST or not np.isfinite(result.residual):
                break
            tighter *= 0.3 * result.tolerance / result.residual
        return result


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
        for i, one in enumerate(basis):
            H[i, k] = one @ v
            v -= H[i, k] * one
        H[k + 1, k] = np.linalg.norm(v)
        begin = length * np.eye(1, k + 2)[0]
        answer = np.linalg.lstsq(H[: k + 2, : k + 1], begin, rcond=None)[0]
        left = float(np.linalg.norm(begin - H[: k + 2, : k + 1] @ answer))
        if not left > goal or H[k + 1, k] == 0.0:
            break
        basis.append(v / H[k + 1, k])
    return np.asarray(answer @ np.array(moved)), len(moved)
