"""Factors of a state that is near, which precondition linear systems of states that follow each other.

A step in time, another moment, a trial of a fit each changes a tangent a little. Where the matrix is indefinite
(`warpbrain.simulation.coupled`) three to six products with them do what takes hundreds of iterations without. Of a
definite one, on the CPU, conjugate gradients with a coarse space (`warpbrain.kernels.linear`) are as soon done.
"""

from __future__ import annotations

import abc
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpbrain.arrays import Floats
from warpbrain.kernels.linear import LinearResult, LinearSolver
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


#: Iterations after which factors are of no use, and with new ones the plain solver takes over.
MOST = 60


class FactoredSolver(abc.ABC):
    """Solves a system's linear systems, to a relative tolerance, with factors that are kept from one to the next.

    These are made, and made anew, as needed; the `plain` solver takes over where they do not help.
    """

    #: Whether a matrix that is not positive definite is of no use.
    _definite = True

    def __init__(self, system: System, plain: LinearSolver, factors: KeptFactors, tolerance: float) -> None:
        self._system, self._plain, self._factors, self._tolerance = system, plain, factors, tolerance
        self._free = ~system.model.constrained.ravel()
        self._K: Any = None
        self._result: LinearResult | None = None

    def multiply(self, x: wp.array, z: wp.array) -> None:
        self._plain.multiply(x, z)

    def solve(self, tolerance: float | None = None) -> None:
        """See `LinearSolver`; begins with zero."""
        self._result = self._with_factors(self._tolerance if tolerance is None else tolerance)
        if self._result is None or not (self._result.converged or self._result.indefinite):
            self._result = None
            self._system.solution.zero_()
            self._plain.solve(tolerance)

    def _with_factors(self, wanted: float) -> LinearResult | None:
        """How a solve with factors ended, of this matrix where others do not help; None if it has none."""
        for renews in (False, True):
            if renews:
                if not self._factors.renew(self._K, self._free, self._definite):
                    return None
            elif not self._factors.serve(self._free, self._definite):
                continue
            result = self._try(wanted)
            self._factors.count(result.iterations)
            if result.converged or result.indefinite:
                break
        return result

    @abc.abstractmethod
    def _try(self, wanted: float) -> LinearResult:
        """Solve with the factors that there are."""

    def result(self) -> LinearResult:
        return self._result or self._plain.result()
