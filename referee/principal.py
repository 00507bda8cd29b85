"""Kernels of many deformation gradients: principal stretches, by Jacobi's rotations, and derivatives in their axes."""

from __future__ import annotations

import numpy as np
import warp as wp
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Singular vectors `u` and `v` (m, q, 3, 3) and values (m, q, 3) of deformation gradients `u diag(stretch) v^T`.
Stretches = tuple[Floats, Floats, Floats]

#: What is left beside the diagonal of a matrix of trace 1, squared, when it is taken for diagonal, and sweeps at most.
_LEFT, _SWEEPS = wp.constant(wp.float64(1e-36)), wp.constant(12)


@wp.func
def _turned(p: wp.float64, q: wp.float64, pq: wp.float64, rp: wp.float64, rq: wp.float64, vp: wp.vec3d, vq: wp.vec3d):
    """Rows and columns p and q of a symmetric matrix turned so that nothing is between them (Golub and Van Loan, 8.5).

    Returned are the diagonal entries of both, those with the third row, and both axes.
    """
    t = wp.float64(0.0)
    if pq != wp.float64(0.0):
        theta = (q - p) / (wp.float64(2.0) * pq)
        t = wp.float64(1.0) / (wp.abs(theta) + wp.sqrt(theta * theta + wp.float64(1.0)))
        if theta < wp.float64(0.0):
            t = -t
    c = wp.float64(1.0) / wp.sqrt(t * t + wp.float64(1.0))
    s = t * c
    return p - t * pq, q + t * pq, c * rp - s * rq, s * rp + c * rq, c * vp - s * vq, s * vp + c * vq


@wp.kernel(enable_backward=False)
def _stretches(
    F: wp.array(dtype=wp.mat33d),
    u: wp.array(dtype=wp.mat33d),
    v: wp.array(dtype=wp.mat33d),
    stretch: wp.array(dtype=wp.vec3d),
):
    i = wp.tid()
    C = wp.transpose(F[i]) * F[i]
    xx = C[0, 0]
    yy = C[1, 1]
    zz = C[2, 2]
    xy = C[0, 1]
    xz = C[0, 2]
    yz = C[1, 2]
    one, none = wp.float64(1.0), wp.float64(0.0)
    a = wp.vec3d(one, none, none)
    b = wp.vec3d(none, one, none)
    c = wp.vec3d(none, none, one)
    close = _LEFT * (xx + yy + zz) * (xx + yy + zz)
    sweep = wp.int32(0)
    while sweep < _SWEEPS and xy * xy + xz * xz + yz * yz > close:
        xx, yy, xz, yz, a, b = _turned(xx, yy, xy, xz, yz, a, b)
        xx, zz, xy, yz, a, c = _turned(xx, zz, xz, none, yz, a, c)
        yy, zz, xy, xz, b, c = _turned(yy, zz, yz, xy, none, b, c)
        yz = none
        sweep += 1
    axes = wp.matrix_from_cols(a, b, c)
    l = wp.vec3d(wp.sqrt(xx), wp.sqrt(yy), wp.sqrt(zz))
    v[i] = axes
    stretch[i] = l
    u[i] = F[i] * axes * wp.diag(wp.vec3d(one / l[0], one / l[1], one / l[2]))


@wp.kernel(enable_backward=False)
def _derivatives(
    u: wp.array(dtype=wp.mat33d),
    v: wp.array(dtype=wp.mat33d),
    both: wp.array(dtype=wp.mat33d),
    same: wp.array(dtype=wp.mat33d),
    other: wp.array(dtype=wp.mat33d),
    out: wp.array2d(dtype=wp.mat33d),
):
    """``out[J, L][i, k]`` of the entries (ii, jj), (ij, ij) and (ij, ji) in principal axes."""
    n = wp.tid()
    turn = u[n]
    back = wp.transpose(turn)
    first = both[n]
    cross = other[n]
    for J in range(3):
        for L in range(J, 3):
            p = wp.vec3d(v[n][J, 0], v[n][J, 1], v[n][J, 2])
            q = wp.vec3d(v[n][L, 0], v[n][L, 1], v[n][L, 2])
            inner = wp.cw_mul(first, wp.outer(p, q)) + wp.cw_mul(cross, wp.outer(q, p))
            inner = inner + wp.diag(same[n] * wp.cw_mul(p, q))
            block = turn * inner * back
            out[n, 3 * J + L] = block
            if L > J:
                out[n, 3 * L + J] = wp.transpose(block)


def stretches_of(F: Floats) -> Stretches:
    """Principal stretches and their axes of deformation gradients (..., 3, 3)."""
    u, v, stretch = np.empty(F.shape), np.empty(F.shape), np.empty(F.shape[:-1])
    arrays = [_matrices(F), _matrices(u), _matrices(v)]
    arrays.append(wp.array(stretch.reshape(-1, 3), dtype=wp.vec3d, device="cpu", copy=False))
    wp.launch(_stretches, dim=len(arrays[0]), inputs=arrays, device="cpu")
    return u, v, stretch


def derivatives(u: Floats, v: Floats, both: Floats, same: Floats, other: Floats) -> Floats:
    """Derivative of a stress ``P_iJ`` by a deformation gradient ``F_kL``, as (..., J, L, i, k).

    Parameters
    ----------
    u, v : (..., 3, 3) array
        Principal axes of `P` and `F`, in columns, of the rows and of the columns of `F`.
    both, same, other : (..., 3, 3) array
        Entries (ii, jj), (ij, ij) and (ij, ji) in these axes; the last two are zero where i is j.
    """
    out = np.empty((*u.shape[:-2], 3, 3, 3, 3))
    inputs = [*map(_matrices, (u, v, both, same, other)), _matrices(out).reshape((-1, 9))]
    wp.launch(_derivatives, dim=len(inputs[0]), inputs=inputs, device="cpu")
    return out


def _matrices(x: Floats) -> wp.array:
    """Those of an array (..., 3, 3), in the same memory."""
    return wp.array(np.ascontiguousarray(x).reshape(-1, 3, 3), dtype=wp.mat33d, device="cpu", copy=False)
