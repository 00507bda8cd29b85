"""Kernels of energies that are added to a tetrahedron's own: functions of `F` with a direction or a tensor.

A term brings device functions of the elastic deformation gradient and of a row of numbers of its element:

    energy(F_e, data, e) -> Psi [Pa]
    moduli(F_e, g, h, data, e) -> g . dP/dF . h [Pa/m2] for two gradients of shape functions, symmetric in its use
    stress(F_e, data, e) -> P [Pa]

The growth stretch of an element is the last of its numbers (`warpbrain.kernels.tetrahedron.of_elastic_part`).
"""

from functools import cache
from typing import Any

import warp as wp

from warpbrain.kernels.module import Precision
from warpbrain.kernels.tetrahedron import Stencil, element_kernels, of_elastic_part


@cache
def extra_kernels(
    key: str, energy: Any, stress: Any, moduli: Any, precision: Precision, stencil: Stencil
) -> tuple[Any, Any, Any, Any]:
    """Make (once) what kernels for forces, forces with tangent blocks, and energies know, and these.

    `key` is part of the name of the compiled module; `energy`, `stress` and `moduli` are the term's, as above.
    """
    scalar, mat33 = precision.scalar, precision.mat33

    @wp.func
    def tangents(F: mat33, D: mat33, V: scalar, data: wp.array2d[scalar], e: int):
        """`V P`, and `V d_j . dP/dF . d_k` for the rows of `D`, j <= k."""
        a, b, c = D[0], D[1], D[2]
        return (
            V * stress(F, data, e),
            V * moduli(F, a, a, data, e),
            V * moduli(F, a, b, data, e),
            V * moduli(F, a, c, data, e),
            V * moduli(F, b, b, data, e),
            V * moduli(F, b, c, data, e),
            V * moduli(F, c, c, data, e),
        )

    functions = of_elastic_part(stress, energy, tangents, precision)
    return element_kernels(key, *functions, precision, stencil, of_term=True)
