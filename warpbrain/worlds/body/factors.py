"""The factors of a stiffness matrix, and equilibria under many forces by them.

A GPU for which CuPy is installed has dense ones; see `dense_factors`. On a host forces that are sparse are taken in
blocks of columns, which are dense for a moment only.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import SolveError
from warpbrain.simulation.sparse_factors import SparseFactors
from warpbrain.worlds.body.dense_factors import dense_factors

#: Columns that are solved together.
_TOGETHER = 256


class Factors:
    """Factors of a positive definite matrix, symmetric if they are on a GPU, all but symmetric on the host.

    `matrix` SciPy sparse matrix (n, n). `device`: a GPU that may hold them; the host unless given. `symmetric`: whether
    the matrix is exactly that. `SolveError` if it is singular.
    """

    def __init__(self, matrix: Any, device: Any = None, symmetric: bool = True) -> None:
        self._skew = None if symmetric else matrix
        self._dense = None if device is None else dense_factors(matrix, device)
        if self._dense is not None:
            return
        try:
            self._factors = SparseFactors(matrix, symmetric)
        except RuntimeError as error:
            raise SolveError(f"the state is unstable: its tangent stiffness cannot be factorised ({error})") from None

    def solve(self, columns: Any, transposed: bool = False) -> Floats:
        """Solution (n, k) for right-hand sides (n, k), an array or SciPy sparse, in Fortran order.

        `transposed`: with the transposed matrix.
        """
        if transposed and self._skew is not None:
            return self._transposed.solve(columns)
        if self._dense is not None:
            return self._dense.solve(columns)
        return self._filled(columns, columns.shape[0], lambda solution: solution)

    @cached_property
    def _transposed(self) -> Factors:
        """Factors of the transposed: by those of the matrix one column after the other would be answered.

        That takes longer than new factors for as many columns as there are sensors.
        """
        assert self._skew is not None
        return Factors(self._skew.T, symmetric=False)

    def between(self, left: Any, columns: Any) -> Floats:
        """`left A^-1 columns` (m, k) of SciPy sparse matrices (m, n) and (n, k), dense a block at a time only."""
        if self._dense is not None:
            return self._dense.between(left, columns)
        return self._filled(columns, left.shape[0], lambda solution: left @ solution)

    def _filled(self, columns: Any, rows: int, of: Callable[[Floats], Floats]) -> Floats:
        """A function of the solution for each block of columns, side by side."""
        from scipy.sparse import issparse

        columns = columns.tocsc() if issparse(columns) else columns
        result = np.empty((rows, columns.shape[1]), order="F")
        for first in range(0, columns.shape[1], _TOGETHER):
            part = slice(first, first + _TOGETHER)
            block = columns[:, part].toarray() if issparse(columns) else columns[:, part]
            result[:, part] = of(self._factors.solve(block))
        return result
