"""Kernels of conjugate gradients for many systems of one pattern, each with scalars, sums and an end of its own."""

from functools import cache, partial
from typing import Any

import warp as wp

from warpbrain.kernels.batched.layout import (
    ROWS,
    SHARES,
    block_of,
    sample_kernel,
    store_symmetric,
    store_vector,
    symmetric_of,
    vector_of,
)
from warpbrain.kernels.module import KernelSet, Precision


@cache
def batched_solve_kernels(precision: Precision) -> tuple[Any, KernelSet]:
    """Make (once) what the kernels of batched conjugate gradients in a precision know, and these.

    The last index of each kernel is a lane.
    """
    scalar, vec3 = precision.scalar, precision.vec3
    kernels = KernelSet(f"linear_{precision.name}_batched")
    rows = wp.constant(ROWS)
    shares_each = wp.constant(SHARES)

    @wp.struct
    class Systems:
        # of the pattern; blocks says where `A_ij`, or for j < i its transpose, is kept
        offsets: wp.array[int]
        columns: wp.array[int]
        blocks: wp.array[int]
        diagonal: wp.array[int]
        free: wp.array[vec3]
        # of each system, see `BatchedConjugateGradient`
        values: wp.array3d[scalar]
        v: wp.array3d[scalar]
        x: wp.array3d[scalar]
        r: wp.array3d[scalar]
        z: wp.array3d[scalar]
        p: wp.array3d[scalar]
        q: wp.array3d[scalar]
        inverse: wp.array3d[scalar]
        # shares of three sums, and what their second stage leaves of these
        shares: wp.array3d[scalar]
        sums: wp.array3d[scalar]
        alpha: wp.array[scalar]
        beta: wp.array[scalar]
        rr: wp.array[scalar]
        rz: wp.array[scalar]
        goal: wp.array[scalar]
        iterations: wp.array[int]
        solving: wp.array[int]
        tolerance: scalar
        max_iterations: int

    of_samples = partial(sample_kernel, kernels, Systems)

    @wp.func
    def row_product(s: Systems, x: wp.array3d[scalar], i: int, slot: int):
        """`sum_j A_ij x_j` of a sample."""
        y = vec3()
        for k in range(s.offsets[i], s.offsets[i + 1]):
            j = s.columns[k]
            A = block_of(s.values, s.blocks[k], 0, slot)
            if j < i:
                A = wp.transpose(A)
            y += A * vector_of(x, j, slot)
        return y

    @of_samples
    def invert_diagonal(i: int, slot: int, s: Systems):
        """One thread for a node: the inverse of its diagonal block."""
        store_symmetric(s.inverse, i, 0, slot, wp.inverse(block_of(s.values, s.diagonal[i], 0, slot)))

    @of_samples
    def start(chunk: int, slot: int, s: Systems):
        """One thread for `ROWS` nodes: `b - A v` on free components, of `b` in the place of `r`, residual
        `r = b - A v - A x`, `z = D^-1 r`, `p = z`; shares of `|b - A v|^2`, `r . r` and `r . z`."""
        bb = scalar(0.0)
        rr = scalar(0.0)
        rz = scalar(0.0)
        for i in range(chunk * rows, wp.min((chunk + 1) * rows, s.x.shape[0])):
            Av = row_product(s, s.v, i, slot)
            b = vector_of(s.r, i, slot) - wp.cw_mul(s.free[i], Av)
            ri = b - row_product(s, s.x, i, slot)
            zi = symmetric_of(s.inverse, i, 0, slot) * ri
            store_vector(s.r, i, slot, ri)
            store_vector(s.z, i, slot, zi)
            store_vector(s.p, i, slot, zi)
            bb += wp.dot(b, b)
            rr += wp.dot(ri, ri)
            rz += wp.dot(ri, zi)
        s.shares[0, chunk, slot] = bb
        s.shares[1, chunk, slot] = rr
        s.shares[2, chunk, slot] = rz

    @of_samples
    def product(chunk: int, slot: int, s: Systems):
        """Likewise: `q = A p`; shares of `p . q`."""
        pq = scalar(0.0)
        for i in range(chunk * rows, wp.min((chunk + 1) * rows, s.p.shape[0])):
            qi = row_product(s, s.p, i, slot)
            store_vector(s.q, i, slot, qi)
            pq += wp.dot(vector_of(s.p, i, slot), qi)
        s.shares[0, chunk, slot] = pq

    @of_samples
    def advance(chunk: int, slot: int, s: Systems):
        """Likewise: `x += alpha p`, `r -= alpha q`, `z = D^-1 r`; shares of `r . r` and `r . z`."""
        a = s.alpha[slot]
        rr = scalar(0.0)
        rz = scalar(0.0)
        for i in range(chunk * rows, wp.min((chunk + 1) * rows, s.x.shape[0])):
            store_vector(s.x, i, slot, vector_of(s.x, i, slot) + a * vector_of(s.p, i, slot))
            ri = vector_of(s.r, i, slot) - a * vector_of(s.q, i, slot)
            zi = symmetric_of(s.inverse, i, 0, slot) * ri
            store_vector(s.r, i, slot, ri)
            store_vector(s.z, i, slot, zi)
            rr += wp.dot(ri, ri)
            rz += wp.dot(ri, zi)
        s.shares[0, chunk, slot] = rr
        s.shares[1, chunk, slot] = rz

    @of_samples
    def turn(chunk: int, slot: int, s: Systems):
        """Likewise: `p = z + beta p`."""
        b = s.beta[slot]
        for i in range(chunk * rows, wp.min((chunk + 1) * rows, s.p.shape[0])):
            store_vector(s.p, i, slot, vector_of(s.z, i, slot) + b * vector_of(s.p, i, slot))

    @kernels.add
    def add_shares(slots: wp.array[int], count: wp.array[int], shares: wp.array3d[scalar], sums: wp.array3d[scalar]):
        """Second stage of the sums, one thread for `SHARES` shares."""
        quantity, group, lane = wp.tid()
        if lane >= count[0]:
            return
        slot = slots[lane]
        total = scalar(0.0)
        for chunk in range(group * shares_each, wp.min((group + 1) * shares_each, shares.shape[1])):
            total += shares[quantity, chunk, slot]
        sums[quantity, group, slot] = total

    @wp.func
    def total_of(sums: wp.array3d[scalar], quantity: int, slot: int):
        total = scalar(0.0)
        for group in range(sums.shape[1]):
            total += sums[quantity, group, slot]
        return total

    @of_samples
    def finish_start(i: int, slot: int, s: Systems):
        """Third stage, one thread for a sample: its scalars, and whether it goes on."""
        s.goal[slot] = s.tolerance * s.tolerance * total_of(s.sums, 0, slot)
        s.rr[slot] = total_of(s.sums, 1, slot)
        s.rz[slot] = total_of(s.sums, 2, slot)
        s.iterations[slot] = 0
        s.solving[slot] = 0
        # written so that a residual that is not a number is the end
        if s.rr[slot] > s.goal[slot]:
            s.solving[slot] = 1

    @of_samples
    def finish_product(i: int, slot: int, s: Systems):
        s.alpha[slot] = s.rz[slot] / total_of(s.sums, 0, slot)

    @of_samples
    def finish_advance(i: int, slot: int, s: Systems):
        new = total_of(s.sums, 1, slot)
        s.beta[slot] = new / s.rz[slot]
        s.rz[slot] = new
        s.rr[slot] = total_of(s.sums, 0, slot)
        s.iterations[slot] = s.iterations[slot] + 1
        if not (s.rr[slot] > s.goal[slot]) or s.iterations[slot] >= s.max_iterations:
            s.solving[slot] = 0

    @kernels.add
    def gather_active(
        slots: wp.array[int],
        count: wp.array[int],
        solving: wp.array[int],
        active: wp.array[int],
        active_count: wp.array[int],
    ):
        """One thread for a lane: the list of the slots that go on, in the order of the list they come from."""
        lane = wp.tid()
        if lane == 0 and count[0] == 0:
            active_count[0] = 0
        if lane >= count[0]:
            return
        # each lane counts those before it: no order of threads matters
        place = wp.int32(0)
        for other in range(lane):  # type: ignore[arg-type]
            place += solving[slots[other]]
        slot = slots[lane]
        if solving[slot] != 0:
            active[place] = slot
        if lane == count[0] - 1:
            active_count[0] = place + solving[slot]

    @kernels.add
    def add_sums(slots: wp.array[int], count: wp.array[int], sums: wp.array3d[scalar], totals: wp.array2d[scalar]):
        """Third stage of sums that are only looked at, one thread for a quantity."""
        quantity, lane = wp.tid()
        if lane >= count[0]:
            return
        totals[quantity, slots[lane]] = total_of(sums, quantity, slots[lane])

    @kernels.add
    def go_on(active_count: wp.array[int], linger: wp.array[int], condition: wp.array[int]):
        """One thread: whether more go on than may linger."""
        condition[0] = 0
        if active_count[0] > linger[0]:
            condition[0] = 1

    return Systems, kernels
