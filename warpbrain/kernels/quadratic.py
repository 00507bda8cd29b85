"""Kernels of a law on ten-node tetrahedra; see `warpbrain.kernels.ten_nodes`."""

from dataclasses import replace
from functools import cache

import warp as wp

from warpbrain.kernels.module import compiled_module
from warpbrain.kernels.precision import Precision
from warpbrain.kernels.ten_nodes import POINTS, UNROLL, add_blocks, add_forces, gradient_at
from warpbrain.kernels.tetrahedron import DeviceLaw, ElementKernels


@cache
def quadratic_kernels(law: DeviceLaw, precision: Precision) -> ElementKernels:
    """Make (once) the element kernels of a law for elements of ten nodes, (m, 10) arrays of int.

    ``energy`` also gives the smallest `J` of an element's quadrature points.
    """
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    module = compiled_module(f"{law.key}_{precision.name}_quadratic", unroll=UNROLL)
    linear = law.kernels(precision)
    stress_at, energy_at, tangents_at = linear.stress_at, linear.energy_at, linear.tangents
    share = wp.constant(scalar(1.0 / POINTS))

    @wp.kernel(module=module)
    def forces(
        start: int,
        elements: wp.array[int],
        nodes: wp.array2d[int],
        inverse_edges: wp.array[mat33],
        volume: wp.array[scalar],
        parameters: wp.array2d[scalar],
        u: wp.array[vec3],
        element_forces: wp.array2d[vec3],
    ):
        e = elements[start + wp.tid()]
        G = inverse_edges[e]
        for point in range(POINTS):
            F = gradient_at(u, nodes, e, point, G)
            add_forces(share * volume[e] * stress_at(F, parameters, e), point, G, element_forces, e)

    @wp.kernel(module=module)
    def forces_and_tangents(
        start: int,
        elements: wp.array[int],
        nodes: wp.array2d[int],
        inverse_edges: wp.array[mat33],
        volume: wp.array[scalar],
        parameters: wp.array2d[scalar],
        u: wp.array[vec3],
        element_forces: wp.array2d[vec3],
        element_blocks: wp.array2d[mat33],
    ):
        e = elements[start + wp.tid()]
        G = inverse_edges[e]
        axes = wp.identity(n=3, dtype=scalar)
        for point in range(POINTS):
            F = gradient_at(u, nodes, e, point, G)
            VP, A00, A01, A02, A11, A12, A22 = tangents_at(F, axes, share * volume[e], parameters, e)
            add_forces(VP, point, G, element_forces, e)
            add_blocks(A00, A01, A02, A11, A12, A22, point, G, element_blocks, e)

    @wp.kernel(module=module)
    def energy(
        start: int,
        elements: wp.array[int],
        nodes: wp.array2d[int],
        inverse_edges: wp.array[mat33],
        volume: wp.array[scalar],
        parameters: wp.array2d[scalar],
        u: wp.array[vec3],
        element_energy: wp.array[scalar],
        element_J: wp.array[scalar],
    ):
        e = elements[start + wp.tid()]
        stored = scalar(0.0)
        smallest = scalar(0.0)
        for point in range(POINTS):
            F = gradient_at(u, nodes, e, point, inverse_edges[e])
            J = wp.determinant(F)
            # so that a J that is no number counts as smallest
            if point == 0 or not (smallest <= J):
                smallest = J
            if J > scalar(0.0):  # noqa: SIM300  (a scalar of the device, not a constant)
                stored += share * volume[e] * energy_at(F, parameters, e)
        element_energy[e] = stored
        element_J[e] = smallest

    return replace(linear, forces=forces, forces_and_tangents=forces_and_tangents, energy=energy)
