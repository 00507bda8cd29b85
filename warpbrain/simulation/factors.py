"""Factors of sparse matrices, and those of a state that is near, which precondition systems of states that follow.

Factors are by RSLAB: supernodes in the order of a nested dissection.

Of a brain of 5,000 nodes they take a fifth of the time of SciPy's SuperLU, and a solution a third
(``python bench/factors.py``). They are the same to the bit for any number of threads. A fork of a process that has used
it has SuperLU instead.

A step in time, another moment, a trial of a fit each changes a tangent a little. Where the matrix is indefinite
(`warpbrain.simulation.coupled`) three to six products with factors of a state nearby do what takes hundreds of
iterations without. Of a definite one conjugate gradients are sooner done (`warpbrain.kernels.linear`), on a CPU with a
coarse space, on a GPU because an iteration takes microseconds: 16 ms for an equilibrium of 0529 on an H200, where a
kept inverse of the stiffness took 21, and a diagnosis as long (2026-11-26).
"""

import os
from typing import Any

import numpy as np

from warpbrain.arrays import Bools, Floats
from warpbrain.threads import thread_count


class SparseFactors:
    """Factors `L D L^T` of a symmetric matrix, SciPy sparse (n, n), whose lower triangle is read.

    `RuntimeError` if it is singular.
    """

    def __init__(self, matrix: Any) -> None:
        from scipy.sparse import tril

        if _is_fork:
            from scipy.sparse.linalg import splu

            options = {"SymmetricMode": True}
            A = matrix.tocsc().astype(np.float64)
            self._solve = splu(A, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options).solve
            return

        global _is_used
        _is_used = True
        pattern = tril(matrix).tocsc().astype(np.float64)
        pattern.sum_duplicates()
        self._solve = _analysed(pattern).factor(pattern.data).solve_many

    def solve(self, columns: Floats) -> Floats:
        """Solution (n,) or (n, k) for right-hand sides (n,) or (n, k), an array of which Fortran order is faster."""
        columns = np.asarray(columns, dtype=np.float64)
        solution = np.asarray(self._solve(np.asfortranarray(columns.reshape(len(columns), -1))))
        return solution.reshape(columns.shape)


#: Symbolic analyses of the last symmetric patterns, a quarter of the work each: a body has one for all of its states.
_analyses: list[tuple[int, Any, Any]] = []
_KEPT = 4


def _analysed(lower: Any) -> Any:
    """The symbolic analysis of a lower triangle, SciPy CSC without duplicates; it does not depend on the values."""
    import rslab

    for threads, pattern, analysis in _analyses:
        same = threads == thread_count() and np.array_equal(pattern.indptr, lower.indptr)
        if same and np.array_equal(pattern.indices, lower.indices):
            return analysis
    analysis = rslab.analyze(lower, path="ldlt", threads=thread_count())
    _analyses[:] = [(thread_count(), lower, analysis), *_analyses[: _KEPT - 1]]
    return analysis


#: Whether RSLAB was used, and whether this is a fork of a process in which it was: its threads do not live on in a
#: fork, which would wait for them for ever.
_is_used = _is_fork = False


def _after_fork() -> None:
    global _is_fork
    _is_fork = _is_fork or _is_used


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)


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
