"""From elements to the systems of many samples: ordered sums into nodes and into the blocks of each matrix.

The matrices are symmetric: the blocks `A_ij` with i <= j are kept, one for each pair of nodes that share an element.
"""

from functools import cache
from typing import TypeAlias

import warp as wp

from warpbrain.kernels.batched.layout import ROWS, samples_struct, store_block, store_vector, tangent_of, vector_of
from warpbrain.kernels.module import KernelSet
from warpbrain.kernels.precision import Precision


@cache
def batched_assembly_kernels(precision: Precision) -> KernelSet:
    """Make (once) the batched assembly kernels of a precision; the last index of each is a lane."""
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    kernels = KernelSet(f"assembly_{precision.name}_batched")
    Samples: TypeAlias = samples_struct(precision)
    rows = wp.constant(ROWS)

    @kernels.add
    def gather_matrix(slots: wp.array[int], count: wp.array[int], s: Samples):
        """One thread for a pair of nodes and its block `A_ij = k K_ij + m M_ij`, with `k` and `m` of the sample and the
        rows and columns of constrained components replaced by those of the identity."""
        p, lane = wp.tid()
        if lane >= count[0]:
            return
        slot = slots[lane]
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

    @kernels.add
    def gather_forces(slots: wp.array[int], count: wp.array[int], s: Samples):
        """One thread for `ROWS` nodes: internal forces, and the shares of the squared norms of what is out of balance
        on the free components and of the internal forces."""
        chunk, lane = wp.tid()
        if lane >= count[0]:
            return
        slot = slots[lane]
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

    @kernels.add
    def constrained_load(slots: wp.array[int], count: wp.array[int], s: Samples):
        """One thread for a node: subtract `k K d`, of elements' forces `K d`, from the right-hand side."""
        i, lane = wp.tid()
        if lane >= count[0]:
            return
        slot = slots[lane]
        f = vec3()
        for c in range(s.corner_first[i], s.corner_first[i + 1]):
            f += vector_of(s.element_forces, s.corners[c], slot)
        store_vector(s.b, i, slot, vector_of(s.b, i, slot) - wp.cw_mul(s.free[i], s.k[slot] * f))

    return kernels
