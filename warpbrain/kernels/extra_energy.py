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
from warpbrain.kernels.ten_nodes import POINTS, UNROLL, add_blocks, add_forces, gradient_at
from warpbrain.kernels.tetrahedron import deformation_gradient, store_blocks, store_forces


@cache
def extra_kernels(key: str, energy: Any, stress: Any, moduli: Any, precision: Precision) -> tuple[Any, Any, Any]:
    """Kernels for forces, forces with tangent blocks, and energies, with one thread for an element of a list.

    Parameters
    ----------
    key : str
        Part of the name of the compiled module.
    energy, stress, moduli : wp.func
    precision : Precision
    """
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    module = compiled_module(f"{key}_{precision.name}")

    @wp.kernel(module=module)
    def forces(
        elements: wp.array[int],
        nodes: wp.array[wp.vec4i],
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
        F = deformation_gradient(u, nodes[e], G) / s
        store_forces(scale[0] * volume[t] * s * s * stress(F, data, t), G, element_forces, t)

    @wp.kernel(module=module)
    def tangents(
        elements: wp.array[int],
        nodes: wp.array[wp.vec4i],
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
        F = deformation_gradient(u, nodes[e], G) / s
        V = scale[0] * volume[t] * s
        store_forces(V * s * stress(F, data, t), G, element_forces, t)
        a, b, c = G[0], G[1], G[2]
        store_blocks(
            V * moduli(F, a, a, data, t),
            V * moduli(F, a, b, data, t),
            V * moduli(F, a, c, data, t),
            V * moduli(F, b, b, data, t),
            V * moduli(F, b, c, data, t),
            V * moduli(F, c, c, data, t),
            element_blocks,
            t,
        )

    @wp.kernel(module=module)
    def energies(
        elements: wp.array[int],
        nodes: wp.array[wp.vec4i],
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
        F = deformation_gradient(u, nodes[e], inverse_edges[e]) / s
        out[t] = scale[0] * volume[t] * s * s * s * energy(F, data, t)

    return forces, tangents, energies


@cache
def quadratic_extra_kernels(
    key: str, energy: Any, stress: Any, moduli: Any, precision: Precision
) -> tuple[Any, Any, Any]:
    """The same for elements of ten nodes, (m, 10) arrays of int; see `warpbrain.kernels.ten_nodes`."""
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    module = compiled_module(f"{key}_{precision.name}_quadratic", unroll=UNROLL)
    share = wp.constant(scalar(1.0 / POINTS))

    @wp.kernel(module=module)
    def forces(
        elements: wp.array[int],
        nodes: wp.array2d[int],
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
        for point in range(POINTS):
            F = gradient_at(u, nodes, e, point, G) / s
            add_forces(V * stress(F, data, t), point, G, element_forces, t)

    @wp.kernel(module=module)
    def tangents(
        elements: wp.array[int],
        nodes: wp.array2d[int],
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
        axes = wp.identity(n=3, dtype=scalar)
        a, b, c = axes[0], axes[1], axes[2]
        for point in range(POINTS):
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
        nodes: wp.array2d[int],
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
        found = scalar(0.0)
        for point in range(POINTS):
            F = gradient_at(u, nodes, e, point, inverse_edges[e]) / s
            found += energy(F, data, t)
        out[t] = share * scale[0] * volume[t] * s * s * s * found

    return forces, tangents, energies
