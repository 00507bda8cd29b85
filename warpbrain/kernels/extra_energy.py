"""Kernels of energies that are added to a tetrahedron's own: functions of `F` with a direction or a tensor.

A term brings device functions of the elastic deformation gradient and of a row of numbers of its element:

    energy(F_e, data, e) -> Psi [Pa]
    moduli(F_e, g, h, data, e) -> g . dP/dF . h [Pa/m2] for two gradients of shape functions, symmetric in its use
    stress(F_e, data, e) -> P [Pa]

With the growth stretch `s` of an element, the last of its numbers, `F_e = F/s`, the energy of its reference volume is
`s^3 Psi(F/s)`, so `P = s^2 P_e` and `dP/dF = s dP_e/dF_e` (as in `warpbrain.physics.laws.device`).
"""

from functools import cache
from typing import Any

import warp as wp

from warpbrain.kernels.module import Precision
from warpbrain.kernels.tetrahedron import Stencil, element_kernels


@cache
def extra_kernels(
    key: str, energy: Any, stress: Any, moduli: Any, precision: Precision, stencil: Stencil
) -> tuple[Any, Any, Any, Any]:
    """Make (once) what kernels for forces, forces with tangent blocks, and energies know, and these.

    `key` is part of the name of the compiled module; `energy`, `stress` and `moduli` are the term's, as above.
    """
    scalar, mat33 = precision.scalar, precision.mat33

    @wp.func
    def stretch_of(data: wp.array2d[scalar], e: int):
        return data[e, data.shape[1] - 1]

    @wp.func
    def stress_of(F: mat33, data: wp.array2d[scalar], e: int):
        s = stretch_of(data, e)
        return s * s * stress(F / s, data, e)

    @wp.func
    def energy_of(F: mat33, data: wp.array2d[scalar], e: int):
        s = stretch_of(data, e)
        return s * s * s * energy(F / s, data, e)

    @wp.func
    def tangents_of(F: mat33, D: mat33, V: scalar, data: wp.array2d[scalar], e: int):
        """`V P`, and `V d_j . dP/dF . d_k` for the rows of `D`, j <= k."""
        s = stretch_of(data, e)
        F_e, V_s = F / s, V * s
        a, b, c = D[0], D[1], D[2]
        return (
            V_s * s * stress(F_e, data, e),
            V_s * moduli(F_e, a, a, data, e),
            V_s * moduli(F_e, a, b, data, e),
            V_s * moduli(F_e, a, c, data, e),
            V_s * moduli(F_e, b, b, data, e),
            V_s * moduli(F_e, b, c, data, e),
            V_s * moduli(F_e, c, c, data, e),
        )

    return element_kernels(key, stress_of, energy_of, tangents_of, precision, stencil, of_term=True)
