"""Kernels of energies that are added to a tetrahedron's own: functions of `F` with a direction or a tensor.

A term brings device functions of the elastic deformation gradient and of a row of numbers of its element:

    energy(F_e, data, e) -> Psi [Pa]
    moduli(F_e, g, h, data, e) -> g . dP/dF . h [Pa/m2] for two gradients of shape functions, symmetric in its use
    stress(F_e, data, e) -> P [Pa]

With the growth stretch `s` of an element, `F_e = F/s`, the energy of its reference volume is `s^3 Psi(F/s)`, so
`P = s^2 P_e` and `dP/dF = s dP_e/dF_e` (as in `warpbrain.physics.laws.device`).
"""

from functools import cache
from typing import Any

import warp as wp

from warpbrain.kernels.module import compiled_module
from warpbrain.kernels.precision import Precision
from warpbrain.kernels.tetrahedron import Stencil


@cache
def extra_kernels(
    key: str, energy: Any, stress: Any, moduli: Any, precision: Precision, stencil: Stencil
) -> tuple[Any, Any, Any]:
    """Make (once) kernels for forces, forces with tangent blocks, and energies, one thread for an element of a list.

    `key` is part of the name of the compiled module; `energy`, `stress` and `moduli` are the term's, as above.
    """
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    module = compiled_module(f"{key}_{precision.name}{stencil.suffix}", stencil.unroll)
    nodes_type, points, share = stencil.nodes, stencil.points, wp.constant(scalar(1.0 / stencil.points))
    gradient_at, directions_of = stencil.gradient, stencil.directions
    add_forces, add_blocks = stencil.forces, stencil.blocks

    @wp.kernel(module=module)
    def forces(
        elements: wp.array[int],
        nodes: nodes_type,
        inverse_edges: wp.array[mat33],
        volume: wp.array[scalar],
        stretch: wp.array[scalar],
        data: wp.array2d[scalar],
        scale: wp.array[scalar],
        u: wp.array[vec3],
        element_forces: wp.array2d[vec3],
    ):
        t = wp.tid()
        e = elements[t]
        G = inverse_edges[e]
        s = stretch[t]
        V = share * scale[0] * volume[t] * s * s
        for point in range(points):
            F = gradient_at(u, nodes, e, point, G) / s
            add_forces(V * stress(F, data, t), point, G, element_forces, t)

    @wp.kernel(module=module)
    def tangents(
        elements: wp.array[int],
        nodes: nodes_type,
        inverse_edges: wp.array[mat33],
        volume: wp.array[scalar],
        stretch: wp.array[scalar],
        data: wp.array2d[scalar],
        scale: wp.array[scalar],
        u: wp.array[vec3],
        element_forces: wp.array2d[vec3],
        element_blocks: wp.array2d[mat33],
    ):
        t = wp.tid()
        e = elements[t]
        G = inverse_edges[e]
        s = stretch[t]
        V = share * scale[0] * volume[t] * s
        D = directions_of(G)
        a, b, c = D[0], D[1], D[2]
        for point in range(points):
            F = gradient_at(u, nodes, e, point, G) / s
            add_forces(V * s * stress(F, data, t), point, G, element_forces, t)
            add_blocks(
                V * moduli(F, a, a, data, t),
                V * moduli(F, a, b, data, t),
                V * moduli(F, a, c, data, t),
                V * moduli(F, b, b, data, t),
                V * moduli(F, b, c, data, t),
                V * moduli(F, c, c, data, t),
                point,
                G,
                element_blocks,
                t,
            )

    @wp.kernel(module=module)
    def energies(
        elements: wp.array[int],
        nodes: nodes_type,
        inverse_edges: wp.array[mat33],
        volume: wp.array[scalar],
        stretch: wp.array[scalar],
        data: wp.array2d[scalar],
        scale: wp.array[scalar],
        u: wp.array[vec3],
        out: wp.array[scalar],
    ):
        t = wp.tid()
        e = elements[t]
        s = stretch[t]
        total = scalar(0.0)
        for point in range(points):
            F = gradient_at(u, nodes, e, point, inverse_edges[e]) / s
            total += energy(F, data, t)
        out[t] = share * scale[0] * volume[t] * s * s * s * total

    return forces, tangents, energies
