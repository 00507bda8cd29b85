"""Displacement and pressure solved for together on the host, with factors that are kept.

The matrix of `warpbrain.simulation.coupled` is indefinite. Flexible generalised minimal residuals (Saad, Iterative
Methods for Sparse Linear Systems, 2nd ed., section 9.4) are preconditioned by the block triangle

    [      K0        0  ]
    [ -sqrt(w) B    -S0 ],    S0 = A + w Y,

`K0` of a state that is near, and `Y` what the term says that the solid gives way to its unknowns (`Coupling.yielding`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Floats
from warpbrain.kernels.linear import LinearResult
from warpbrain.simulation.coupled import FIRST, ROUNDS, CoupledSolver
from warpbrain.simulation.kept_factors import KeptFactors
from warpbrain.simulation.sparse_factors import SparseFactors

if TYPE_CHECKING:
    from warpbrain.simulation.system import System


class CoupledBlock:
    """The system's matrix with a term's own unknowns, on the host.

    Parameters
    ----------
    system : System
    captured : CoupledSolver
        Of that system.
    K : SciPy BSR matrix (3 n, 3 n)
        What is in blocks [N/m], constrained rows and columns replaced by the identity.
    free : (3 n,) bool array
    before : CoupledBlock, optional
        Of the matrix before: its factors of `S0` are taken if that is still the same.
    """

    def __init__(
        self, system: System, captured: CoupledSolver, K: Any, free: NDArray[np.bool_], before: CoupledBlock | None
    ) -> None:
        from scipy.sparse import csr_matrix, diags

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
            self._schur: SparseFactors = before._schur
        else:
            self._schur = SparseFactors(self._S)

    def solve(self, load: Floats, wanted: float, factors: KeptFactors, most: int) -> LinearResult:
        """Leave the displacement under a load (3 n,) in the system's solution; how that ended.

        Parameters
        ----------
        load : (3 n,) array
            [N], zero on constrained components.
        wanted : float
            Residual of the system without pressures, relative to the load.
        factors : KeptFactors
            Of a `K` that is near.
        most : int
            Iterations.
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
        b = np.concatenate([load, np.zeros(self._system.size)])
        x, tighter, iterations = np.zeros_like(b), FIRST, 0
        for _ in range(ROUNDS):
            more, steps = _minimal_residual(
                operator, preconditioner, b - operator(x), weight,
                tighter * wanted * float(np.linalg.norm(weight * b)), most - iterations,
            )  # fmt: skip
            x, iterations = x + more, iterations + steps
            self._system.solution.assign(x[:size].reshape(-1, 3))
            result = self._captured.look(iterations, wanted)
            if result.converged or steps == 0 or iterations >= most or not np.isfinite(result.residual):
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
