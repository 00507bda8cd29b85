"""Element kernels of energies `Psi(I1, I2, J)`: functions of the invariants of `C = F^T F` and of `J = det F`.

With `B = F F^T`, `cof F = J F^-T`, `S = I1 F - F C` and subscripts of `Psi` for partial derivatives,

    P = 2 Psi_1 F + 2 Psi_2 S + Psi_J cof F.

`dI1 = 2 F : dF`, `dI2 = 2 S : dF` and `dJ = cof F : dF` give the products of second derivatives in the tangent; the
other terms are the derivatives of `F`, `S` and `cof F` (Bonet and Wood, Nonlinear Continuum Mechanics for Finite
Element Analysis, 2nd ed., chapters 5 and 6). A law brings two device functions:

    energy(I1, I2, J, parameters, e) -> Psi
    derivatives(I1, I2, J, parameters, e) -> Psi_1, Psi_2, Psi_J, Psi_11, Psi_12, Psi_1J, Psi_22, Psi_2J, Psi_JJ
"""

from functools import cache
from typing import Any

import warp as wp

from warpbrain.kernels.module import Precision
from warpbrain.kernels.tetrahedron import ElementKernels, law_kernels


@wp.func
def cofactor(F: Any):
    """Cofactor matrix `det(F) F^-T`, defined for a singular `F` too."""
    return wp.matrix_from_rows(wp.cross(F[1], F[2]), wp.cross(F[2], F[0]), wp.cross(F[0], F[1]))


@cache
def invariant_kernels(
    key: str, energy_density: Any, derivatives: Any, second_invariant: bool, precision: Precision
) -> ElementKernels:
    """Make (once) the element kernels of a law in invariants, whose name `key` is part of that of its compiled module.

    Without `second_invariant` every term of `I2` is left out of the compiled code (`I2` is then passed as zero).
    """
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33

    @wp.func
    def second_of(cof: mat33):
        # I2 = |cof F|^2 has no cancellation, unlike (I1^2 - C : C) / 2
        result = scalar(0.0)
        if wp.static(second_invariant):
            result = wp.ddot(cof, cof)
        return result

    @wp.func
    def stress_of(F: mat33, parameters: wp.array2d[scalar], e: int):
        cof = cofactor(F)
        I1 = wp.ddot(F, F)
        two = scalar(2.0)
        d1, d2, dJ, _11, _12, _1J, _22, _2J, _JJ = derivatives(I1, second_of(cof), wp.dot(F[0], cof[0]), parameters, e)
        P = two * d1 * F + dJ * cof
        if wp.static(second_invariant):
            P += two * d2 * (I1 * F - F * wp.transpose(F) * F)
        return P

    @wp.func
    def energy_of(F: mat33, parameters: wp.array2d[scalar], e: int):
        cof = cofactor(F)
        return energy_density(wp.ddot(F, F), second_of(cof), wp.dot(F[0], cof[0]), parameters, e)

    @wp.func
    def first_block(
        fa: vec3, fb: vec3, ca: vec3, cb: vec3, isotropic: scalar, M11: scalar, M1J: scalar, MJJ: scalar, mJ: scalar
    ):
        """The terms without `I2`; `fa = F a`, `ca = cof F a`."""
        towards_f = M11 * fb + M1J * cb
        towards_c = M1J * fb + (MJJ + mJ) * cb
        K = wp.outer(fa, towards_f) + wp.outer(ca, towards_c) - wp.outer(mJ * cb, ca)
        K[0, 0] += isotropic
        K[1, 1] += isotropic
        K[2, 2] += isotropic
        return K

    @wp.func
    def second_block(
        fa: vec3, fb: vec3, ca: vec3, cb: vec3, sa: vec3, sb: vec3, ab: scalar, I1: scalar, B: mat33,
        m2: scalar, M12: scalar, M22: scalar, M2J: scalar,
    ):  # fmt: skip
        """The terms of `I2`; `sa = S a`."""
        towards_s = M12 * fb + M22 * sb + M2J * cb
        K = wp.outer(sa, towards_s) + wp.outer(M12 * fa + M2J * ca, sb)
        K += m2 * (scalar(2.0) * wp.outer(fa, fb) - wp.outer(fb, fa) - ab * B)
        isotropic = m2 * (I1 * ab - wp.dot(fa, fb))
        K[0, 0] += isotropic
        K[1, 1] += isotropic
        K[2, 2] += isotropic
        return K

    @wp.func
    def tangents_of(F: mat33, G: mat33, V: scalar, parameters: wp.array2d[scalar], e: int):
        """`V P` and the tangent blocks of nodes 1 to 3, whose shape-function gradients are the rows of `G`."""
        cof = cofactor(F)
        J = wp.dot(F[0], cof[0])
        I1 = wp.ddot(F, F)
        two = scalar(2.0)
        d1, d2, dJ, d11, d12, d1J, d22, d2J, dJJ = derivatives(I1, second_of(cof), J, parameters, e)
        m1 = V * two * d1
        m2 = V * two * d2
        mJ = V * dJ / J
        M11 = V * two * two * d11
        M1J = V * two * d1J
        MJJ = V * dJJ
        a1, a2, a3 = G[0], G[1], G[2]
        f1, f2, f3 = F * a1, F * a2, F * a3
        c1, c2, c3 = cof * a1, cof * a2, cof * a3
        p11, p12, p13 = wp.dot(a1, a1), wp.dot(a1, a2), wp.dot(a1, a3)
        p22, p23, p33 = wp.dot(a2, a2), wp.dot(a2, a3), wp.dot(a3, a3)
        K11 = first_block(f1, f1, c1, c1, m1 * p11, M11, M1J, MJJ, mJ)
        K12 = first_block(f1, f2, c1, c2, m1 * p12, M11, M1J, MJJ, mJ)
        K13 = first_block(f1, f3, c1, c3, m1 * p13, M11, M1J, MJJ, mJ)
        K22 = first_block(f2, f2, c2, c2, m1 * p22, M11, M1J, MJJ, mJ)
        K23 = first_block(f2, f3, c2, c3, m1 * p23, M11, M1J, MJJ, mJ)
        K33 = first_block(f3, f3, c3, c3, m1 * p33, M11, M1J, MJJ, mJ)
        VP = m1 * F + (V * dJ) * cof
        if wp.static(second_invariant):
            M12 = V * two * two * d12
            M22 = V * two * two * d22
            M2J = V * two * d2J
            B = F * wp.transpose(F)
            S = I1 * F - B * F
            s1, s2, s3 = S * a1, S * a2, S * a3
            K11 += second_block(f1, f1, c1, c1, s1, s1, p11, I1, B, m2, M12, M22, M2J)
            K12 += second_block(f1, f2, c1, c2, s1, s2, p12, I1, B, m2, M12, M22, M2J)
            K13 += second_block(f1, f3, c1, c3, s1, s3, p13, I1, B, m2, M12, M22, M2J)
            K22 += second_block(f2, f2, c2, c2, s2, s2, p22, I1, B, m2, M12, M22, M2J)
            K23 += second_block(f2, f3, c2, c3, s2, s3, p23, I1, B, m2, M12, M22, M2J)
            K33 += second_block(f3, f3, c3, c3, s3, s3, p33, I1, B, m2, M12, M22, M2J)
            VP += m2 * S
        return VP, K11, K12, K13, K22, K23, K33

    return law_kernels(key, stress_of, energy_of, tangents_of, precision)
