"""Element kernels of energies `Psi(l1, l2, l3)` in the principal stretches: the spectral form.

With the singular value decomposition `F = U diag(l) V^T`, `T_i = dPsi/dl_i` and `H_ij = d^2 Psi/(dl_i dl_j)`,

    P = U diag(T) V^T,

and in the principal axes the moduli `A_ijkl = dP_ij/dF_kl` are `A_iijj = H_ij` and, for i != j,

    A_ijij = (m + p) / 2,  A_ijji = (m - p) / 2,  m = (T_i - T_j) / (l_i - l_j),  p = (T_i + T_j) / (l_i + l_j)

(Ogden, Non-linear Elastic Deformations, section 6.1). The difference quotient `m` is what fails at coincident stretches
when it is computed as written: each law gives it in a form without cancellation. A law brings two device functions:

    energy(l, parameters, e) -> Psi
    derivatives(l, parameters, e) -> T (vec3), H (mat33), m of the pairs (0, 1), (0, 2), (1, 2) (vec3)

The decomposition is by one-sided Jacobi rotations. `warp.svd3` of Warp 1.19 reconstructs its argument to 1e-14 in
double but only to 7e-3 in single precision; one-sided Jacobi (Hestenes 1958; Demmel and Veselic 1992) keeps every
singular value to a few rounding errors in both, coincident ones included, and costs less near the identity, where it
ends after one sweep.
"""

from functools import cache
from typing import Any

import warp as wp

from warpbrain.kernels.module import Precision
from warpbrain.kernels.tetrahedron import ElementKernels, law_kernels

#: Jacobi converges quadratically; six sweeps reach round-off for any 3 x 3 matrix that an element can have.
SWEEPS = wp.constant(6)


@wp.func
def _orthogonalise(w0: Any, w1: Any, r0: Any, r1: Any, small: Any):
    """Rotate the rows `w0`, `w1` (and `r0`, `r1` with them) until `w0 . w1 = 0`; the last value says whether it did."""
    one = type(small)(1.0)
    a = wp.dot(w0, w0)
    b = wp.dot(w1, w1)
    g = wp.dot(w0, w1)
    if g * g <= small * a * b:
        return w0, w1, r0, r1, 0
    # tangent, cosine and sine of the angle
    zeta = (b - a) / (type(small)(2.0) * g)
    t = one / (wp.abs(zeta) + wp.sqrt(one + zeta * zeta))
    if zeta < type(small)(0.0):
        t = -t
    c = one / wp.sqrt(one + t * t)
    s = c * t
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


@cache
def principal_kernels(key: str, energy_density: Any, derivatives: Any, precision: Precision) -> ElementKernels:
    """Make (once) the element kernels of a law in principal stretches; `key` is part of the compiled module's name."""
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    small = wp.constant(scalar(precision.epsilon**2))

    @wp.func
    def block(p: vec3, q: vec3, H: mat33, same: vec3, swap: vec3, U: mat33):
        """`a . dP/dF . b` for `p = V^T a`, `q = V^T b`."""
        M = mat33(
            H[0, 0] * p[0] * q[0] + same[0] * p[1] * q[1] + same[1] * p[2] * q[2],
            H[0, 1] * p[0] * q[1] + swap[0] * p[1] * q[0],
            H[0, 2] * p[0] * q[2] + swap[1] * p[2] * q[0],
            H[0, 1] * p[1] * q[0] + swap[0] * p[0] * q[1],
            H[1, 1] * p[1] * q[1] + same[0] * p[0] * q[0] + same[2] * p[2] * q[2],
            H[1, 2] * p[1] * q[2] + swap[2] * p[2] * q[1],
            H[0, 2] * p[2] * q[0] + swap[1] * p[0] * q[2],
            H[1, 2] * p[2] * q[1] + swap[2] * p[1] * q[2],
            H[2, 2] * p[2] * q[2] + same[1] * p[0] * q[0] + same[2] * p[1] * q[1],
        )
        return U * M * wp.transpose(U)

    @wp.func
    def stress_of(F: mat33, parameters: wp.array2d[scalar], e: int):
        U, l, V = singular_value_decomposition(F, small)
        T, _H, _m = derivatives(l, parameters, e)
        return U * wp.diag(T) * wp.transpose(V)

    @wp.func
    def energy_of(F: mat33, parameters: wp.array2d[scalar], e: int):
        _U, l, _V = singular_value_decomposition(F, small)
        return energy_density(l, parameters, e)

    @wp.func
    def tangents_of(F: mat33, G: mat33, volume: scalar, parameters: wp.array2d[scalar], e: int):
        """`V P` and the tangent blocks of nodes 1 to 3, whose shape-function gradients are the rows of `G`."""
        U, l, V = singular_value_decomposition(F, small)
        T, H, m = derivatives(l, parameters, e)
        p = vec3((T[0] + T[1]) / (l[0] + l[1]), (T[0] + T[2]) / (l[0] + l[2]), (T[1] + T[2]) / (l[1] + l[2]))
        VP = volume * (U * wp.diag(T) * wp.transpose(V))
        H = volume * H
        # `A_ijij` and `A_ijji` of the pairs (0, 1), (0, 2), (1, 2)
        half = scalar(0.5)
        same = volume * (half * (m + p))
        swap = volume * (half * (m - p))
        # the rows of G V are V^T g_a
        GV = G * V
        p1, p2, p3 = GV[0], GV[1], GV[2]
        return (
            VP,
            block(p1, p1, H, same, swap, U),
            block(p1, p2, H, same, swap, U),
            block(p1, p3, H, same, swap, U),
            block(p2, p2, H, same, swap, U),
            block(p2, p3, H, same, swap, U),
            block(p3, p3, H, same, swap, U),
        )

    return law_kernels(key, stress_of, energy_of, tangents_of, precision)
