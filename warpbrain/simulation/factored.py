"""Linear systems solved on the host, preconditioned by the factors of a state that is near.

On the CPU one solve with factors takes as long as some ten iterations of the captured loops of `warpbrain.kernels`.
Where many states follow each other three to six of them do what takes conjugate gradients 50 to 200 iterations, and
MINRES 50 to 1,500. Where fluid has a pressure beside the displacement: `warpbrain.simulation.coupled_block`. On a GPU:
`warpbrain.simulation.kept_inverse`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warpbrain.kernels.host_gradients import host_gradients
from warpbrain.kernels.linear import LinearResult
from warpbrain.simulation.coupled import CoupledSolver, LinearSolver
from warpbrain.simulation.coupled_block import CoupledBlock
from warpbrain.simulation.kept_factors import KeptFactors

if TYPE_CHECKING:
    from warpbrain.simulation.system import System


#: Iterations after which factors are of no use, and with new ones the captured loop takes over.
MOST = 60


class FactoredSolver:
    """Solves a system's linear systems with factors that are kept from one to the next.

    Parameters
    ----------
    system : System
        On the CPU.
    captured : LinearSolver
        Of that system: takes over where factors do not help.
    factors : KeptFactors
        Made, and made anew, as needed.
    tolerance : float
        Relative.
    """

    def __init__(self, system: System, captured: LinearSolver, factors: KeptFactors, tolerance: float) -> None:
        self._system, self._captured, self._factors, self._tolerance = system, captured, factors, tolerance
        self._free = ~system.model.constrained.ravel()
        self._K: Any = None
        self._block: CoupledBlock | None = None
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
        x, left = np.zeros_like(load), load.copy()
        goal = wanted * float(np.linalg.norm(load))
        result = host_gradients(lambda p: self._K @ p, self._factors.solve, x, left, goal, MOST)
        self._system.solution.assign(x.reshape(-1, 3))
        return result

    def result(self) -> LinearResult:
        """See `LinearSolver`."""
        return self._result or self._captured.result()
