"""Kernels of a time step of many samples, each with a step length, a time and loads of its own.

See `warpbrain.simulation.dynamics` for the equations. Sums of what elements have, into nodes and into the blocks of
each matrix, have an order; of the symmetric matrices the blocks `A_ij` with i <= j are kept, one for each pair of nodes
that share an element. Displacements are in double precision whatever the others are: that of a body that moves far has
no digits to lose to the strain of its elements.
"""

from functools import cache, partial
from typing import Any, TypeAlias

import warp as wp

from warpbrain.kernels.batched.layout import (
    ROWS,
    narrowed,
    sample_kernel,
    samples_struct,
    store_block,
    store_vector,
    tangent_of,
    vector_of,
    widened,
)
from warpbrain.kernels.module import KernelSet, Precision


@cache
def batched_motion_kernels(precision: Precision) -> KernelSet:
    """Make (once) the batched kernels of a time step in a precision, unless said one thread for a node and a lane."""
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    kernels = KernelSet(f"motion_{precision.name}_batched")
    Samples: TypeAlias = samples_struct(precision)
    rows = wp.constant(ROWS)
    of_samples = partial(sample_kernel, kernels, Samples)

    @kernels.add
    def restore(slots: wp.array[int], s: Samples):
        """Back to the start of the step, with no guess for its solution."""
        i, lane = wp.tid()
        slot = slots[lane]
        store_vector(s.u, i, slot, vector_of(s.u_start, i, slot))
        store_vector(s.v, i, slot, vector_of(s.v_start, i, slot))
        store_vector(s.dv, i, slot, vec3())

    @kernels.add
    def reset(slots: wp.array[int], s: Samples):
        """At rest in the reference shape."""
        i, lane = wp.tid()
        slot = slots[lane]
        store_vector(s.u, i, slot, wp.vec3d())
        store_vector(s.v, i, slot, vec3())
        store_vector(s.dv, i, slot, vec3())

    @of_samples
    def prescribe(i: int, slot: int, s: Samples):
        """Velocity of the constrained components that takes them to where they must be at the end of the step."""
        goal = vec3()
        for shape in range(s.shapes.shape[0]):
            goal += s.amounts[shape, slot] * s.shapes[shape, i]
        held = vec3(scalar(1.0), scalar(1.0), scalar(1.0)) - s.free[i]
        way = narrowed(widened(goal) - vector_of(s.u, i, slot), s.prescribed)
        store_vector(s.prescribed, i, slot, wp.cw_mul(held, way / s.h[slot]))

    @of_samples
    def begin(i: int, slot: int, s: Samples):
        """Keeps the state and writes the right-hand side `b = M v + h (f_ext - f_int)` on the free components."""
        vi = vector_of(s.v, i, slot)
        store_vector(s.u_start, i, slot, vector_of(s.u, i, slot))
        store_vector(s.v_start, i, slot, vi)
        external = vec3()
        for load in range(s.loads.shape[0]):
            external += s.factors[load, slot] * s.loads[load, i]
        step = s.h[slot] * (external - vector_of(s.internal, i, slot))
        store_vector(s.b, i, slot, wp.cw_mul(s.free[i], s.mass[i] * vi + step))

    @of_samples
    def update(i: int, slot: int, s: Samples):
        """Velocity and displacement at the end of the step, of the samples whose linear solve has ended."""
        if s.solving[slot] != 0:
            return
        prescribed = vector_of(s.prescribed, i, slot)
        change = vector_of(s.v_start, i, slot) + vector_of(s.dv, i, slot) - prescribed
        w = wp.cw_mul(s.free[i], change) + prescribed
        store_vector(s.v, i, slot, w)
        store_vector(s.u, i, slot, vector_of(s.u_start, i, slot) + widened(s.h[slot] * w))

    @kernels.add
    def find_ready(
        marked: wp.array[int],
        stepping: wp.array[int],
        solving: wp.array[int],
        ready: wp.array[int],
        number: wp.array[scalar],
    ):
        """One thread for a slot: 1 where a state is to be evaluated, one that has just been reached or one that is
        marked; as a flag, and as a number beside those of the step."""
        slot = wp.tid()
        ready[slot] = marked[slot]
        if stepping[slot] != 0 and solving[slot] == 0:
            ready[slot] = 1
        number[slot] = scalar(ready[slot])

    @kernels.add
    def collect(slots: wp.array[int], nodes: wp.array[int], x: wp.array3d[Any], collected: wp.array[wp.vec3d]):
        """One thread for a slot of a list and a node of a list: vectors of a sample side by side, as they leave the
        device."""
        place, k = wp.tid()
        collected[place * nodes.shape[0] + k] = widened(vector_of(x, nodes[k], slots[place]))

    @of_samples
    def gather_matrix(p: int, slot: int, s: Samples):
        """One thread for a pair of nodes and its block `A_ij = k K_ij + m M_ij`, with `k` and `m` of the sample and the
        rows and columns of constrained components replaced by those of the identity."""
        K = mat33()
        for c in range(s.pair_first[p], s.pair_first[p + 1]):
            K += tangent_of(s.tangents, s.contributions[c] / 10, s.contributions[c] % 10, slot)
        i = s.pairs[p][0]
        j = s.pairs[p][1]
        A = wp.cw_mul(s.k[slot] * K, wp.outer(s.free[i], s.free[j]))
        if i == j:
            one = scalar(1.0)
            inertia = s.m[slot] * s.mass[i]
            for c in range(3):
                A[c, c] += s.free[i][c] * inertia + (one - s.free[i][c])
        store_block(s.values, p, 0, slot, A)

    @of_samples
    def gather_forces(chunk: int, slot: int, s: Samples):
        """One thread for `ROWS` nodes: internal forces, and the shares of the squared norms of what is out of balance
        on the free components and of the internal forces."""
        unbalanced = scalar(0.0)
        size = scalar(0.0)
        for i in range(chunk * rows, wp.min((chunk + 1) * rows, s.internal.shape[0])):
            f = vec3()
            for c in range(s.corner_first[i], s.corner_first[i + 1]):
                f += vector_of(s.element_forces, s.corners[c], slot)
            store_vector(s.internal, i, slot, f)
            lack = wp.cw_mul(s.free[i], s.external[i] - f)
            unbalanced += wp.dot(lack, lack)
            size += wp.dot(f, f)
        s.shares[0, chunk, slot] = unbalanced
        s.shares[1, chunk, slot] = size

    @kernels.add
    def smallest(
        slots: wp.array[int], count: wp.array[int], size: int, values: wp.array2d[scalar], least: wp.array2d[scalar]
    ):
        """One thread for a share of the elements: their smallest `J`, NaN if one is."""
        chunk, lane = wp.tid()
        if lane >= count[0]:
            return
        slot = slots[lane]
        low = values[chunk * size, slot]
        for i in range(chunk * size + 1, wp.min((chunk + 1) * size, values.shape[0])):
            value = values[i, slot]
            # once NaN, for ever NaN
            if low == low and not (value >= low):
                low = value
        least[chunk, slot] = low

    @of_samples
    def constrained_load(i: int, slot: int, s: Samples):
        """One thread for a node: subtract `k K d`, of elements' forces `K d`, from the right-hand side."""
        f = vec3()
        for c in range(s.corner_first[i], s.corner_first[i + 1]):
            f += vector_of(s.element_forces, s.corners[c], slot)
        store_vector(s.b, i, slot, vector_of(s.b, i, slot) - wp.cw_mul(s.free[i], s.k[slot] * f))

    return kernels
