"""Factors of sparse matrices, by RSLAB: supernodes in the order of a nested dissection.

Of a brain of 5,000 nodes they take a fifth of the time of SciPy's SuperLU, and a solution a third
(``python bench/factors.py``). They are the same to the bit for any number of threads.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.threads import thread_count


class SparseFactors:
    """Factors `L D L^T` of a symmetric matrix, or `L U` of another.

    Parameters
    ----------
    matrix : SciPy sparse matrix (n, n)
    symmetric : bool
        Whether it is; of a symmetric one the lower triangle is read.

    Raises
    ------
    RuntimeError
        If it is singular.
    """

    def __init__(self, matrix: Any, symmetric: bool = True) -> None:
        import rslab
        from scipy.sparse import tril

        pattern = (tril(matrix) if symmetric else matrix).tocsc().astype(np.float64)
        pattern.sum_duplicates()
        #: Whether the matrix is positive definite; known of symmetric ones.
        self.is_definite = False
        self._factors: rslab.Ldlt | rslab.Lu
        if symmetric:
            factors = rslab.ldlt(pattern, threads=thread_count())
            self._factors, self.is_definite = factors, factors.inertia[0] == matrix.shape[0]
        else:
            self._factors = rslab.lu(pattern, threads=thread_count())

    def solve(self, columns: Floats) -> Floats:
        """Solution (n,) or (n, k) for right-hand sides (n,) or (n, k), an array of which Fortran order is faster."""
        columns = np.asarray(columns, dtype=np.float64)
        if columns.ndim == 1:
            return np.asarray(self._factors.solve(np.ascontiguousarray(columns)))
        return np.asarray(self._factors.solve_many(np.asfortranarray(columns)))
