"""Element kernels of many samples, made of a law's device functions: forces, tangent blocks and `J`."""

from functools import cache, partial
from typing import Any, TypeAlias

import warp as wp

from warpbrain.kernels.batched.layout import narrowed, samples_struct, store_tangent, store_vector, vector_of
from warpbrain.kernels.module import KernelSet, Precision
from warpbrain.kernels.tetrahedron import DeviceLaw

#: Blocks of 128 threads that share a multiprocessor at least: of more of them registers spill, and elements of
#: Mooney-Rivlin's law take twice as long.
_TOGETHER = {"double": 2, "single": 4}


@cache
def batched_element_kernels(law: DeviceLaw, precision: Precision) -> tuple[Any, KernelSet]:
    """Make (once) what the batched element kernels of a law in a precision know of their elements, and these.

    One thread has an element of the group and a lane.
    """
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    kernels = KernelSet(f"{law.key}_{precision.name}_batched")
    Samples: TypeAlias = samples_struct(precision)
    tangents_of = law.kernels(precision).tangents
    stress_at = law.kernels(precision).stress_at

    @wp.struct
    class Group:
        # and the tissue of each; parameters have a row for each tissue and slot, slots fastest
        elements: wp.array[int]
        tissue: wp.array[int]
        parameters: wp.array2d[scalar]

    @wp.func
    def gradient_of(s: Samples, e: int, slot: int):
        """The deformation gradient, of differences that have all digits of their precision."""
        nodes = s.nodes[e]
        u0 = vector_of(s.u, nodes[0], slot)
        u1 = narrowed(vector_of(s.u, nodes[1], slot) - u0, s.element_forces)
        u2 = narrowed(vector_of(s.u, nodes[2], slot) - u0, s.element_forces)
        u3 = narrowed(vector_of(s.u, nodes[3], slot) - u0, s.element_forces)
        return wp.matrix_from_cols(u1, u2, u3) * s.inverse_edges[e] + wp.identity(n=3, dtype=scalar)

    @wp.func
    def store_forces(s: Samples, e: int, slot: int, f1: vec3, f2: vec3, f3: vec3):
        """Set the forces of an element, which add up to nothing."""
        store_vector(s.element_forces, 4 * e, slot, -(f1 + f2 + f3))
        store_vector(s.element_forces, 4 * e + 1, slot, f1)
        store_vector(s.element_forces, 4 * e + 2, slot, f2)
        store_vector(s.element_forces, 4 * e + 3, slot, f3)

    @wp.func
    def store_stress(s: Samples, e: int, slot: int, VP: mat33):
        """Set those of a stress, times the volume."""
        G = s.inverse_edges[e]
        store_forces(s, e, slot, VP * G[0], VP * G[1], VP * G[2])

    @partial(kernels.add, together=(128, _TOGETHER[precision.name]))
    def forces_and_tangents(slots: wp.array[int], count: wp.array[int], group: Group, s: Samples):
        t, lane = wp.tid()
        if lane >= count[0]:
            return
        slot = slots[lane]
        e = group.elements[t]
        row = group.tissue[t] * s.u.shape[2] + slot
        F = gradient_of(s, e, slot)
        s.element_J[e, slot] = wp.determinant(F)
        VP, K11, K12, K13, K22, K23, K33 = tangents_of(F, s.inverse_edges[e], s.volume[e], group.parameters, row)
        store_stress(s, e, slot, VP)
        store_tangent(s.tangents, e, slot, K11, K12, K13, K22, K23, K33)

    @kernels.add
    def forces(slots: wp.array[int], count: wp.array[int], group: Group, s: Samples):
        t, lane = wp.tid()
        if lane >= count[0]:
            return
        slot = slots[lane]
        e = group.elements[t]
        F = gradient_of(s, e, slot)
        s.element_J[e, slot] = wp.determinant(F)
        row = group.tissue[t] * s.u.shape[2] + slot
        store_stress(s, e, slot, s.volume[e] * stress_at(F, group.parameters, row))

    @kernels.add
    def tangents_times(slots: wp.array[int], count: wp.array[int], group: Group, s: Samples):
        """`K d` of each element, `d` the prescribed velocities: zero on most nodes."""
        t, lane = wp.tid()
        if lane >= count[0]:
            return
        slot = slots[lane]
        e = group.elements[t]
        nodes = s.nodes[e]
        d0 = vector_of(s.prescribed, nodes[0], slot)
        d1 = vector_of(s.prescribed, nodes[1], slot) - d0
        d2 = vector_of(s.prescribed, nodes[2], slot) - d0
        d3 = vector_of(s.prescribed, nodes[3], slot) - d0
        # all nodes of an element alike: no force
        if d1 == vec3() and d2 == vec3() and d3 == vec3():
            store_forces(s, e, slot, vec3(), vec3(), vec3())
            return
        F = gradient_of(s, e, slot)
        row = group.tissue[t] * s.u.shape[2] + slot
        _, K11, K12, K13, K22, K23, K33 = tangents_of(F, s.inverse_edges[e], s.volume[e], group.parameters, row)
        f1 = K11 * d1 + K12 * d2 + K13 * d3
        f2 = wp.transpose(K12) * d1 + K22 * d2 + K23 * d3
        f3 = wp.transpose(K13) * d1 + wp.transpose(K23) * d2 + K33 * d3
        store_forces(s, e, slot, f1, f2, f3)

    return Group, kernels
