"""Factors of a state that is near, which precondition linear systems of states that follow each other.

A step in time, another moment, a trial of a fit each changes a tangent a little. Where the matrix is indefinite
(`warpbrain.simulation.coupled`) three to six products with them do what takes hundreds of iterations without. Of a
definite one conjugate gradients are sooner done (`warpbrain.kernels.linear`), on a CPU with a coarse space, on a GPU
because an iteration takes microseconds: 16 ms for an equilibrium of 0529 on an H200, where a kept inverse of the
stiffness took 21, and a diagnosis as long (2026-11-26).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from warpbrain.arrays import Bools, Floats
from warpbrain.simulation.sparse_factors import SparseFactors

#: Iterations of a solve with factors that are near, and how many beyond these a factorisation takes as long as.
_NEAR, _WORTH = 5, 25


class KeptFactors:
    """Of the stiffness of the last state that they were renewed at; of none at first."""

    def __init__(self) -> None:
        self._free: Bools | None = None
        self._factors: Any = None
        self._wasted = 0

    def serve(self, free: Bools) -> bool:
        """Whether there are any for these free components (3 n,), near enough to be worth keeping."""
        return self._free is not None and self._wasted <= _WORTH and np.array_equal(self._free, free)

    def count(self, iterations: int) -> None:
        """Take notice of how many iterations a solve took with them."""
        self._wasted += max(iterations - _NEAR, 0)

    def renew(self, stiffness: Any, free: Bools) -> bool:
        """Factorise a stiffness [N/m], SciPy (3 n, 3 n), on its free components (3 n,); False if it is singular."""
        self._free, self._wasted = None, 0
        try:
            self._factors = SparseFactors(stiffness.tocsr()[free][:, free])
        except RuntimeError:
            return False
        self._free = free.copy()
        return True

    def solve(self, forces: Floats) -> Floats:
        """What nodal forces (3 n,) [N] move: (3 n,) [m], zero where components are not free."""
        assert self._free is not None
        displacement = np.zeros(len(forces))
        displacement[self._free] = self._factors.solve(forces[self._free])
        return displacement
