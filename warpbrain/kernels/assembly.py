"""Ordered sums of element results into nodal forces and matrix blocks, inverses of these, and the kernels of a step of
backward Euler.

Every sum is a gather, one thread for a result, over a list of contributions in a fixed order: no atomics, so the same
bits come out of every run on a device.
"""

from functools import cache
from typing import Any

import warp as wp

from warpbrain.kernels.module import KernelSet, Precision


@wp.func
def force_on(first: wp.array[int], corners: wp.array[int], element_forces: wp.array[Any], i: int):
    """The sum of the element forces on node `i`, in a fixed order."""
    f = type(element_forces[0])()
    c = first[i]
    end = first[i + 1]
    # four are on their way before the first is needed
    while c + 4 <= end:
        f0 = element_forces[corners[c]]
        f1 = element_forces[corners[c + 1]]
        f2 = element_forces[corners[c + 2]]
        f3 = element_forces[corners[c + 3]]
        f += f0
        f += f1
        f += f2
        f += f3
        c += 4
    while c < end:
        f += element_forces[corners[c]]
        c += 1
    return f


@cache
def assembly_kernels(precision: Precision) -> KernelSet:
    """Make (once) the assembly kernels of a precision."""
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    kernels = KernelSet(f"assembly_{precision.name}")

    @kernels.add
    def gather_matrix(
        start: int,
        pairs: wp.array[wp.vec2i],
        first: wp.array[int],
        contributions: wp.array[int],
        positions: wp.array[wp.vec2i],
        element_blocks: wp.array[mat33],
        mass: wp.array[scalar],
        free: wp.array[vec3],
        k: scalar,
        m: scalar,
        values: wp.array[mat33],
    ):
        """One thread for a pair of nodes i <= j: `A_ij = k K_ij + m M_ij`, with the rows and columns of constrained
        components replaced by those of the identity. Writes both `A_ij` and `A_ji`."""
        p = start + wp.tid()
        K = mat33()
        for c in range(first[p], first[p + 1]):
            K += element_blocks[contributions[c]]
        i = pairs[p][0]
        j = pairs[p][1]
        # components are 1 where free and 0 where constrained
        A = wp.cw_mul(k * K, wp.outer(free[i], free[j]))
        if i == j:
            one = scalar(1.0)
            inertia = m * mass[i]
            for c in range(3):
                A[c, c] += free[i][c] * inertia + (one - free[i][c])
        values[positions[p][0]] = A
        if i != j:
            values[positions[p][1]] = wp.transpose(A)

    @kernels.add
    def gather_forces(
        start: int,
        first: wp.array[int],
        corners: wp.array[int],
        element_forces: wp.array[vec3],
        forces: wp.array[vec3],
    ):
        """One thread for a node: the sum of the element forces on it."""
        i = start + wp.tid()
        forces[i] = force_on(first, corners, element_forces, i)

    @kernels.add
    def constrained_load(
        start: int,
        offsets: wp.array[int],
        columns: wp.array[int],
        block_pairs: wp.array[int],
        first: wp.array[int],
        contributions: wp.array[int],
        element_blocks: wp.array[mat33],
        increment: wp.array[vec3],
        free: wp.array[vec3],
        k: scalar,
        load: wp.array[vec3],
    ):
        """One thread for a node: subtract `k K d`, of prescribed increments `d`, from the right-hand side. The matrix
        itself cannot be used: it has lost the columns of constrained components."""
        i = start + wp.tid()
        f = vec3()
        for block in range(offsets[i], offsets[i + 1]):
            d = increment[columns[block]]
            # most increments are zero: only what is next to a moved node has work to do
            if wp.dot(d, d) > scalar(0.0):
                pair = block_pairs[block]
                transposed = pair < 0
                if transposed:
                    pair = -1 - pair
                K = mat33()
                for c in range(first[pair], first[pair + 1]):
                    K += element_blocks[contributions[c]]
                if transposed:
                    K = wp.transpose(K)
                f += K * d
        load[i] = load[i] - wp.cw_mul(free[i], k * f)

    @kernels.add
    def invert_diagonal(start: int, diagonal: wp.array[int], values: wp.array[mat33], inverse: wp.array[mat33]):
        """One thread for a node: the inverse of the diagonal block of its row."""
        i = start + wp.tid()
        inverse[i] = wp.inverse(values[diagonal[i]])

    return kernels


@cache
def dynamics_kernels(precision: Precision) -> KernelSet:
    """Make (once) the kernels of a step of backward Euler in a precision, one thread for a node."""
    scalar, vec3 = precision.scalar, precision.vec3
    kernels = KernelSet(f"dynamics_{precision.name}")

    @kernels.add
    def right_hand_side(
        start: int,
        first: wp.array[int],
        corners: wp.array[int],
        element_forces: wp.array[vec3],
        external: wp.array[vec3],
        mass: wp.array[scalar],
        v_start: wp.array[vec3],
        v: wp.array[vec3],
        Av: wp.array[vec3],
        free: wp.array[vec3],
        h: scalar,
        along_Mv: scalar,
        along_Av: scalar,
        internal: wp.array[vec3],
        b: wp.array[vec3],
    ):
        i = start + wp.tid()
        f = force_on(first, corners, element_forces, i)
        internal[i] = f
        momentum = mass[i] * (v_start[i] + along_Mv * v[i])
        b[i] = wp.cw_mul(free[i], momentum + h * (external[i] - f) + along_Av * Av[i])

    @kernels.add
    def update(
        start: int,
        u_start: wp.array[vec3],
        dv: wp.array[vec3],
        v_prescribed: wp.array[vec3],
        free: wp.array[vec3],
        h: scalar,
        v: wp.array[vec3],
        u: wp.array[vec3],
    ):
        i = start + wp.tid()
        w = wp.cw_mul(free[i], v[i] + dv[i] - v_prescribed[i]) + v_prescribed[i]
        v[i] = w
        u[i] = u_start[i] + h * w

    return kernels
