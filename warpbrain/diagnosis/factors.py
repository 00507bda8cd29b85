"""The factors of a stiffness matrix, and equilibria under many forces by them.

Forces are taken in blocks of columns, in threads, since neither products of matrices nor SuperLU hold Python's lock; a
block's answer is the same whoever solves it, so results do not depend on the number of threads.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.multifrontal import Cholesky
from warpbrain.errors import SolveError
from warpbrain.threads import in_threads, one_thread_of_blas

Floats = NDArray[np.float64]

#: Columns that are solved together: fewer are slower, more leave threads without work.
_TOGETHER = 64


class Factors:
    """Factors of a symmetric matrix.

    Parameters
    ----------
    matrix : SciPy sparse matrix (n, n)
        Of a state that is stable, or nearly so: a matrix that is not positive definite takes longer.
    places : (n, 3) array
        Where the nodes of its rows are; rows of one node follow each other.

    Raises
    ------
    SolveError
        If it is singular.
    """

    def __init__(self, matrix: Any, places: Floats) -> None:
        try:
            with one_thread_of_blas():
                self._factors: Any = Cholesky(matrix, places)
        except np.linalg.LinAlgError:
            self._factors = _lower_and_upper(matrix)

    def solve(self, columns: Any) -> Floats:
        """What answers to columns (n, k), an array or SciPy sparse: (n, k)."""
        return self._filled(columns, columns.shape[0], lambda found: found)

    def between(self, left: Any, columns: Any) -> Floats:
        """`left A^-1 columns` (m, k) of SciPy sparse matrices (m, n) and (n, k), dense a block at a time only."""
        return self._filled(columns, left.shape[0], lambda found: left @ found)

    def _filled(self, columns: Any, rows: int, of: Callable[[Floats], Floats]) -> Floats:
        """What is made of the answers to each block, beside each other."""
        from scipy.sparse import issparse

        columns = columns.tocsc() if issparse(columns) else columns
        made = np.empty((rows, columns.shape[1]))

        def solve_block(first: int) -> None:
            block = columns[:, first : first + _TOGETHER]
            block = block.toarray() if issparse(block) else block
            made[:, first : first + _TOGETHER] = of(self._factors.solve(np.asarray(block)))

        in_threads(solve_block, range(0, columns.shape[1], _TOGETHER))
        return made


def _lower_and_upper(matrix: Any) -> Any:
    """SciPy's SuperLU of a symmetric matrix that is not positive definite."""
    from scipy.sparse.linalg import splu

    options = {"SymmetricMode": True}
    try:
        return splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    except RuntimeError as error:
        raise SolveError(f"the state is unstable: its tangent stiffness cannot be factorised ({error})") from None
