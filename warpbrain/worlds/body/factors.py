"""The factors of a stiffness matrix, and equilibria under many forces by them.

On a host forces that are sparse are taken in blocks of columns, which are dense for a moment only. Sparse factors of
5,000 nodes take a fifth of a second, and a thousand right-hand sides more than one. A GPU with fast double precision
for which CuPy, an extra, is installed has the Cholesky factor of all 15,000 rows, zeros included, by cuSOLVER in a
twentieth of that, and a thousand right-hand sides as soon. It takes memory of three such matrices, so what is larger
stays on the host.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, cached_property
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import SolveError
from warpbrain.simulation.sparse_factors import SparseFactors

#: Matrices of the size of the dense one for which there has to be memory, and columns that are solved together.
_MATRICES, _TOGETHER_ON_GPU = 3, 2048
#: Columns that are solved together.
_TOGETHER = 256


class DenseFactors:
    """The Cholesky factor of a symmetric positive definite matrix on a GPU.

    `matrix` SciPy sparse matrix (n, n). `device`: a GPU for which there is CuPy. `numpy.linalg.LinAlgError` if it is
    not positive definite. `MemoryError` if it does not fit into the GPU's memory.
    """

    def __init__(self, matrix: Any, device: Any) -> None:
        import cupy
        import cupyx
        from cupyx.scipy.sparse import csr_matrix

        _require_memory(device, _MATRICES * 8 * matrix.shape[0] ** 2)
        self._device = cupy.cuda.Device(device.ordinal)
        with self._device, cupyx.errstate(linalg="raise"):
            self._L = cupy.linalg.cholesky(csr_matrix(matrix.tocsr().astype(np.float64)).toarray())

    def solve(self, columns: Any) -> Floats:
        """Solution (n, k) for right-hand sides (n, k), an array or SciPy sparse, in Fortran order."""
        return self._filled(columns, len(self._L), None)

    def between(self, left: Any, columns: Any) -> Floats:
        """`left A^-1 columns` (m, k) of SciPy sparse matrices (m, n) and (n, k)."""
        return self._filled(columns, left.shape[0], left)

    def _filled(self, columns: Any, rows: int, projection: Any) -> Floats:
        import cupy
        import cupyx
        from cupyx.scipy.linalg import solve_triangular
        from cupyx.scipy.sparse import csr_matrix

        if columns.shape[1] == 0:
            return np.empty((rows, 0))
        with self._device:
            # pinned memory is copied to several times as fast
            result = cupyx.empty_pinned((rows, columns.shape[1]), dtype=np.float64, order="F")
            projection_on_gpu = None if projection is None else csr_matrix(projection.tocsr().astype(np.float64))
            for first in range(0, columns.shape[1], _TOGETHER_ON_GPU):
                part = slice(first, first + _TOGETHER_ON_GPU)
                forward = solve_triangular(self._L, _on_gpu(columns[:, part]), lower=True, overwrite_b=True)
                answers = solve_triangular(self._L, forward, lower=True, trans="T", overwrite_b=True)
                answers = answers if projection_on_gpu is None else cupy.asfortranarray(projection_on_gpu @ answers)
                answers.get(out=result[:, part])
        return np.asarray(result)


def dense_factors(matrix: Any, device: Any) -> DenseFactors | None:
    """Dense factors where a device can have them, else None.

    It cannot if it is no GPU, if CuPy is not installed for it, if its memory is too small, or if the matrix is not
    positive definite.

    `matrix` SciPy sparse matrix (n, n): symmetric.
    """
    if not _has_cupy(device):
        return None
    try:
        return DenseFactors(matrix, device)
    except (MemoryError, np.linalg.LinAlgError):
        return None


def _has_cupy(device: Any) -> bool:
    """Whether a Warp device is a GPU for which CuPy is installed, and finds the libraries that it calls."""
    return bool(device.is_cuda) and _cupy_works()


@cache
def _cupy_works() -> bool:
    try:
        import cupy
        import cupyx.scipy.linalg  # noqa: F401

        cupy.linalg.cholesky(cupy.eye(2))
    except Exception:
        # whatever keeps an extra from working is no reason to stop: the same is done without it
        return False
    return True


def _require_memory(device: Any, needed: int) -> None:
    """Raise `MemoryError` if a GPU has fewer bytes than these that are free, or that CuPy holds and does not use."""
    import cupy

    with cupy.cuda.Device(device.ordinal) as gpu:
        pool = cupy.get_default_memory_pool()
        free = gpu.mem_info[0] + pool.total_bytes() - pool.used_bytes()
    if needed > free:
        raise MemoryError(f"{needed / 1e9:.1f} GB of memory of {device.alias} are needed, {free / 1e9:.1f} GB are free")


def _on_gpu(columns: Any) -> Any:
    import cupy
    from cupyx.scipy.sparse import csc_matrix
    from scipy.sparse import issparse

    if issparse(columns):
        return csc_matrix(columns.tocsc().astype(np.float64)).toarray(order="F")
    return cupy.asarray(columns, dtype=np.float64, order="F")


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
