"""Sparse factors of symmetric matrices, which stay symmetric while they are factorised."""

from __future__ import annotations

from typing import Any


def symmetric_factors(matrix: Any) -> Any:
    """SciPy's SuperLU of a symmetric matrix, with pivots on the diagonal as long as these are not zero.

    Parameters
    ----------
    matrix : SciPy sparse matrix (n, n)

    Raises
    ------
    RuntimeError
        If it is singular.
    """
    from scipy.sparse.linalg import splu

    return splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
