"""Element kernels of many samples, made of a law's device functions: forces, tangent blocks and `J`."""

from functools import cache, partial

import warp as wp

from warpbrain.kernels.batched.layout import narrowed, store_tangent, store_vector, vector_of
from warpbrain.kernels.module import KernelSet
from warpbrain.kernels.precision import Precision
from warpbrain.kernels.tetrahedron import DeviceLaw

#: Blocks of 128 threads that share a multiprocessor at least: of more of them registers spill, and elements of
#: Mooney-Rivlin's law take twice as long.
_TOGETHER = {"double": 2, "single": 4}


@cache
def batched_element_kernels(law: DeviceLaw, precision: Precision) -> KernelSet:
    """Make (once) the batched element kernels of a law in a precision."""
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    kernels = KernelSet(f"{law.key}_{precision.name}_batched")
    tangents_of = law.kernels(precision).tangents
    stress_at = law.kernels(precision).stress_at

    @wp.func
    def gradient_of(u: wp.array3d[wp.float64], nodes: wp.vec4i, G: mat33, like: wp.array3d[scalar], slot: int):
        """`grad u`, of differences that have all digits of their precision."""
        u0 = vector_of(u, nodes[0], slot)
        u1 = narrowed(vector_of(u, nodes[1], slot) - u0, like)
        u2 = narrowed(vector_of(u, nodes[2], slot) - u0, like)
        u3 = narrowed(vector_of(u, nodes[3], slot) - u0, like)
        return wp.matrix_from_cols(u1, u2, u3) * G

    @wp.func
    def store_forces(element_forces: wp.array3d[scalar], e: int, slot: int, f1: vec3, f2: vec3, f3: vec3):
        """Set the forces of an element, which add up to nothing."""
        store_vector(element_forces, 4 * e, slot, -(f1 + f2 + f3))
        store_vector(element_forces, 4 * e + 1, slot, f1)
        store_vector(element_forces, 4 * e + 2, slot, f2)
        store_vector(element_forces, 4 * e + 3, slot, f3)

    @partial(kernels.add, together=(128, _TOGETHER[precision.name]))
    def forces_and_tangents(
        slots: wp.array[int],
        count: wp.array[int],
        elements: wp.array[int],
        tissue: wp.array[int],
        nodes: wp.array[wp.vec4i],
        inverse_edges: wp.array[mat33],
        volume: wp.array[scalar],
        parameters: wp.array2d[scalar],
        u: wp.array3d[wp.float64],
        element_forces: wp.array3d[scalar],
        tangents: wp.array3d[scalar],
        element_J: wp.array2d[scalar],
    ):
        """One thread for an element of a group and a lane. Parameters have a row for each tissue and slot, slots
        fastest. The force on a corner is in row ``4 e + a``."""
        t, lane = wp.tid()
        if lane >= count[0]:
            return
        slot = slots[lane]
        e = elements[t]
        G = inverse_edges[e]
        F = gradient_of(u, nodes[e], G, element_forces, slot) + wp.identity(n=3, dtype=scalar)
        element_J[e, slot] = wp.determinant(F)
        VP, K11, K12, K13, K22, K23, K33 = tangents_of(F, G, volume[e], parameters, tissue[t] * u.shape[2] + slot)
        store_forces(element_forces, e, slot, VP * G[0], VP * G[1], VP * G[2])
        store_tangent(tangents, e, slot, K11, K12, K13, K22, K23, K33)

    @kernels.add
    def forces(
        slots: wp.array[int],
        count: wp.array[int],
        elements: wp.array[int],
        tissue: wp.array[int],
        nodes: wp.array[wp.vec4i],
        inverse_edges: wp.array[mat33],
        volume: wp.array[scalar],
        parameters: wp.array2d[scalar],
        u: wp.array3d[wp.float64],
        element_forces: wp.array3d[scalar],
        element_J: wp.array2d[scalar],
    ):
        """The same without tangents."""
        t, lane = wp.tid()
        if lane >= count[0]:
            return
        slot = slots[lane]
        e = elements[t]
        G = inverse_edges[e]
        F = gradient_of(u, nodes[e], G, element_forces, slot) + wp.identity(n=3, dtype=scalar)
        element_J[e, slot] = wp.determinant(F)
        VP = volume[e] * stress_at(F, parameters, tissue[t] * u.shape[2] + slot)
        store_forces(element_forces, e, slot, VP * G[0], VP * G[1], VP * G[2])

    @kernels.add
    def tangents_times(
        slots: wp.array[int],
        count: wp.array[int],
        elements: wp.array[int],
        tissue: wp.array[int],
        nodes: wp.array[wp.vec4i],
        inverse_edges: wp.array[mat33],
        volume: wp.array[scalar],
        parameters: wp.array2d[scalar],
        u: wp.array3d[wp.float64],
        d: wp.array3d[scalar],
        element_forces: wp.array3d[scalar],
    ):
        """`K d` of each element, of a `d` that is zero on most nodes."""
        t, lane = wp.tid()
        if lane >= count[0]:
            return
        slot = slots[lane]
        e = elements[t]
        d0 = vector_of(d, nodes[e][0], slot)
        d1 = vector_of(d, nodes[e][1], slot) - d0
        d2 = vector_of(d, nodes[e][2], slot) - d0
        d3 = vector_of(d, nodes[e][3], slot) - d0
        # all nodes of an element alike: no force
        if d1 == vec3() and d2 == vec3() and d3 == vec3():
            store_forces(element_forces, e, slot, vec3(), vec3(), vec3())
            return
        G = inverse_edges[e]
        F = gradient_of(u, nodes[e], G, element_forces, slot) + wp.identity(n=3, dtype=scalar)
        _, K11, K12, K13, K22, K23, K33 = tangents_of(F, G, volume[e], parameters, tissue[t] * u.shape[2] + slot)
        f1 = K11 * d1 + K12 * d2 + K13 * d3
        f2 = wp.transpose(K12) * d1 + K22 * d2 + K23 * d3
        f3 = wp.transpose(K13) * d1 + wp.transpose(K23) * d2 + K33 * d3
        store_forces(element_forces, e, slot, f1, f2, f3)

    return kernels
