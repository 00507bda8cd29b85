"""Element kernels of energies `Psi(l1, l2, l3)` in the principal stretches: the spectral form.

With the singular value decomposition `F = U diag(l) V^T`, `T_i = dPsi/dl_i` and `H_ij = d^2 Psi/(dl_i dl_j)`,

    P = U diag(T) V^T,

and in the principal axes the moduli `A_ijkl = dP_ij/dF_kl` are `A_iijj = H_ij` and, for i != j,

    A_ijij = (m + p) / 2,  A_ijji = (m - p) / 2,  m = (T_i - T_j) / (l_i - l_j),  p = (T_i + T_j) / (l_i + l_j)

(Ogden, Non-linear Elastic Deformations, section 6.1). The difference quotient `m` is what fails at coincident stretches
when it is computed as written: each law gives it in a form without cancellation. A law brings two device functions:

    energy(l, parameters, e) -> Psi
    derivatives(l, parameters, e) -> T (vec3), H (mat33), m of the pairs (0, 1), (0, 2), (1, 2) (vec3)
"""

from functools import cache
from typing import Any

import warp as wp

from warpbrain.kernels.module import compiled_module
from warpbrain.kernels.precision import Precision
from warpbrain.kernels.svd import singular_value_decomposition
from warpbrain.kernels.tetrahedron import ElementKernels, law_kernels


@cache
def principal_kernels(key: str, energy_density: Any, derivatives: Any, precision: Precision) -> ElementKernels:
    """Make (once) the element kernels of a law in principal stretches; `key` is part of the compiled module's name."""
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    pointwise = compiled_module(f"{key}_{precision.name}_pointwise")
    small = wp.constant(scalar(precision.epsilon**2))

    @wp.func
    def shear_moduli(l: vec3, T: vec3, m: vec3):
        """`A_ijij` (first) and `A_ijji` (second) of the pairs (0, 1), (0, 2), (1, 2)."""
        half = scalar(0.5)
        p = vec3((T[0] + T[1]) / (l[0] + l[1]), (T[0] + T[2]) / (l[0] + l[2]), (T[1] + T[2]) / (l[1] + l[2]))
        return half * (m + p), half * (m - p)

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
        same, swap = shear_moduli(l, T, m)
        VP = volume * (U * wp.diag(T) * wp.transpose(V))
        H = volume * H
        same = volume * same
        swap = volume * swap
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

    @wp.kernel(module=pointwise)
    def moduli(
        elements: wp.array[int],
        F: wp.array[mat33],
        parameters: wp.array2d[scalar],
        blocks: wp.array3d[mat33],
    ):
        t, j, k = wp.tid()
        e = elements[t]
        U, l, V = singular_value_decomposition(F[e], small)
        T, H, m = derivatives(l, parameters, e)
        same, swap = shear_moduli(l, T, m)
        # row j of V is V^T e_j
        blocks[e, j, k] = block(V[j], V[k], H, same, swap, U)

    return law_kernels(key, stress_of, energy_of, tangents_of, moduli, precision)
