"""Factors of one stiffness, kept to precondition the systems of many states near to it.

A step in time, another moment, a trial of a fit: each changes a tangent a little, and a factorisation of any of them
nearly solves all.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Floats
from warpbrain.simulation.sparse_factors import SparseFactors

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
