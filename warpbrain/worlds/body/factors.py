"""The factors of a stiffness matrix, and equilibria under many forces by them.

On a host forces that are sparse are taken in blocks of columns, which are dense for a moment only. Sparse factors of
5,000 nodes take a fifth of a second, and a thousand right-hand sides more than one. A GPU with fast double precision
for which CuPy, an extra, is installed has the Cholesky factor of all 15,000 rows, zeros included, by cuSOLVER in a
twentieth of that, and a thousand right-hand sides as soon. It takes memory of three such matrices, so what is larger
stays on the host.

A pressure on a surface whose rim moves has a skew part `N` of the nodes of the rim alone. With the few rows `R` of it,
`Y = S^-1 E_R` and `x = S^-1 b` (Sherman, Morrison and Woodbury; Golub and Van Loan 2013, section 2.1.4)

    (S + N)^-1 b = x - Y (I + N_RR Y_R)^-1 N_RR x_R

and of the transposed the same with `-N`.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from warpbrain.arrays import Floats, Ints
from warpbrain.errors import SolveError
from warpbrain.simulation.factors import SparseFactors
from warpbrain.threads import fill_columns

#: Matrices of the size of the dense one for which there has to be memory, and columns that are solved together.
_MATRICES, _TOGETHER_ON_GPU = 3, 2048
#: Columns that are solved together at most on a host, where more take longer each, and beside a skew part on a GPU.
_TOGETHER, _BESIDE_SKEW = 32, 256


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

    def solve(self, columns: Any, left: Any = None) -> Floats:
        """Solution (n, k) for right-hand sides (n, k), an array or SciPy sparse, in Fortran order.

        `left` SciPy sparse (m, n): its product (m, k) with the solution, if it is given.
        """
        import cupy
        import cupyx
        from cupyx.scipy.linalg import solve_triangular
        from cupyx.scipy.sparse import csr_matrix

        rows = len(self._L) if left is None else left.shape[0]
        if columns.shape[1] == 0:
            return np.empty((rows, 0))
        with self._device:
            # pinned memory is copied to several times as fast
            result = cupyx.empty_pinned((rows, columns.shape[1]), dtype=np.float64, order="F")
            left_on_gpu = None if left is None else csr_matrix(left.tocsr().astype(np.float64))
            for first in range(0, columns.shape[1], _TOGETHER_ON_GPU):
                part = slice(first, first + _TOGETHER_ON_GPU)
                forward = solve_triangular(self._L, _on_gpu(columns[:, part]), lower=True, overwrite_b=True)
                answers = solve_triangular(self._L, forward, lower=True, trans="T", overwrite_b=True)
                answers = answers if left_on_gpu is None else cupy.asfortranarray(left_on_gpu @ answers)
                answers.get(out=result[:, part])
        return np.asarray(result)


def dense_factors(matrix: Any, device: Any) -> DenseFactors | None:
    """Dense factors where a device can have them, else None.

    It cannot if it is no GPU, if CuPy is not installed for it, if its memory is too small, or if the matrix is not
    positive definite.

    `matrix` SciPy sparse matrix (n, n): symmetric.
    """
    if not (device.is_cuda and _cupy_works()):
        return None
    try:
        return DenseFactors(matrix, device)
    except (MemoryError, np.linalg.LinAlgError):
        return None


@cache
def _cupy_works() -> bool:
    """Whether CuPy is installed, and finds the libraries that it calls."""
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
    """Factors of a symmetric positive definite matrix, to which a skew one of few rows may be added.

    `matrix` SciPy sparse (n, n). `device`: a GPU that may hold them; the host unless given. `skew` SciPy sparse (n, n):
    `N`. `SolveError` if the matrix is singular.
    """

    def __init__(self, matrix: Any, device: Any = None, skew: Any = None) -> None:
        self._factors: DenseFactors | SparseFactors | None = None if device is None else dense_factors(matrix, device)
        if self._factors is None:
            try:
                self._factors = SparseFactors(matrix)
            except RuntimeError as error:
                why = f"the state is unstable: its tangent stiffness cannot be factorised ({error})"
                raise SolveError(why) from None
        self._skew = None
        if skew is not None and skew.count_nonzero():
            rows = np.unique(skew.tocoo().row)
            units = np.zeros((matrix.shape[0], len(rows)), order="F")
            units[rows, np.arange(len(rows))] = 1.0
            self._skew = _SkewPart(rows, skew.tocsr()[rows][:, rows].toarray(), self._factors.solve(units))

    def solve(self, columns: Any, transposed: bool = False, left: Any = None) -> Floats:
        """Solution (n, k) for right-hand sides (n, k), an array or SciPy sparse, in Fortran order.

        `transposed`: with the transposed matrix. `left` SciPy sparse (m, n): its product (m, k) with the solution, if
        it is given; the solution is dense a block of columns at a time only.
        """
        from scipy.sparse import issparse

        if isinstance(self._factors, DenseFactors) and self._skew is None:
            return self._factors.solve(columns, left)
        columns = columns.tocsc() if issparse(columns) else columns
        result = np.empty(((columns if left is None else left).shape[0], columns.shape[1]), order="F")
        assert self._factors is not None
        factors, skew = self._factors, self._skew

        def solved(part: slice) -> Any:
            block = columns[:, part].toarray() if issparse(columns) else columns[:, part]
            solution = factors.solve(block)
            if skew is not None:
                solution -= skew.correction(solution, transposed)
            return solution if left is None else left @ solution

        count = max(columns.shape[1], 1)
        if isinstance(factors, DenseFactors):
            for first in range(0, count, _BESIDE_SKEW):
                part = slice(first, first + _BESIDE_SKEW)
                result[:, part] = solved(part)
        else:
            # as large as each other, whatever the number of threads
            fill_columns(result, solved, -(-count // -(-count // _TOGETHER)))
        return result


@dataclass(frozen=True, eq=False)
class _SkewPart:
    """`N_RR` (r, r), the numbers of its rows (r,), and `Y` (n, r)."""

    rows: Ints
    matrix: Floats
    of_rows: Floats

    def correction(self, solution: Floats, transposed: bool) -> Floats:
        """What is taken off a solution (n, k) with the symmetric part alone."""
        N = -self.matrix if transposed else self.matrix
        inner = np.eye(len(N)) + N @ self.of_rows[self.rows]
        return np.asarray(self.of_rows @ np.linalg.solve(inner, N @ solution[self.rows]))
