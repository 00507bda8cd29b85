"""Singular value decomposition of a 3 x 3 matrix with positive determinant, by one-sided Jacobi rotations.

`warp.svd3` of Warp 1.19 reconstructs its argument to 1e-14 in double but only to 7e-3 in single precision; one-sided
Jacobi (Hestenes 1958; Demmel and Veselic 1992) keeps every singular value to a few rounding errors in both, coincident
ones included, and costs less near the identity, where it ends after one sweep.
"""

from typing import Any

import warp as wp

#: Jacobi converges quadratically; six sweeps reach round-off for any 3 x 3 matrix that an element can have.
SWEEPS = wp.constant(6)


@wp.func
def _rotation(alpha: Any, beta: Any, gamma: Any):
    """Cosine and sine of the rotation that makes two columns orthogonal (squared norms alpha, beta; product gamma)."""
    one = type(gamma)(1.0)
    zeta = (beta - alpha) / (type(gamma)(2.0) * gamma)
    t = one / (wp.abs(zeta) + wp.sqrt(one + zeta * zeta))
    if zeta < type(gamma)(0.0):
        t = -t
    c = one / wp.sqrt(one + t * t)
    return c, c * t


@wp.func
def _orthogonalise(w0: Any, w1: Any, r0: Any, r1: Any, small: Any):
    """Rotate the rows `w0`, `w1` (and `r0`, `r1` with them) until `w0 . w1 = 0`; the last value says whether it did."""
    a = wp.dot(w0, w0)
    b = wp.dot(w1, w1)
    g = wp.dot(w0, w1)
    if g * g <= small * a * b:
        return w0, w1, r0, r1, 0
    c, s = _rotation(a, b, g)
    return c * w0 - s * w1, s * w0 + c * w1, c * r0 - s * r1, s * r0 + c * r1, 1


@wp.func
def singular_value_decomposition(F: Any, small: Any):
    """`F = U diag(l) V^T` for `det F > 0`: `U`, `l` and `V`; `U` and `V` orthogonal, `l` positive and unordered.

    `small` is the squared cosine below which two columns count as orthogonal: the square of the rounding error.
    """
    # the rows of W are the columns of F V, the rows of R those of V
    W = wp.transpose(F)
    R = wp.identity(n=3, dtype=F.dtype)
    w0, w1, w2 = W[0], W[1], W[2]
    r0, r1, r2 = R[0], R[1], R[2]
    for _sweep in range(SWEEPS):
        w0, w1, r0, r1, first = _orthogonalise(w0, w1, r0, r1, small)
        w0, w2, r0, r2, second = _orthogonalise(w0, w2, r0, r2, small)
        w1, w2, r1, r2, third = _orthogonalise(w1, w2, r1, r2, small)
        if first + second + third == 0:
            break
    l0 = wp.length(w0)
    l1 = wp.length(w1)
    l2 = wp.length(w2)
    U = wp.matrix_from_cols(w0 / l0, w1 / l1, w2 / l2)
    return U, type(w0)(l0, l1, l2), wp.matrix_from_cols(r0, r1, r2)
