"""Kernels of conjugate gradients for many systems of one pattern, each with scalars, sums and an end of its own."""

from functools import cache

import warp as wp

from warpbrain.kernels.batched.layout import (
    ROWS,
    SHARES,
    block_of,
    row_product,
    store_symmetric,
    store_vector,
    symmetric_of,
    vector_of,
)
from warpbrain.kernels.module import KernelSet
from warpbrain.kernels.precision import Precision


@cache
def batched_solve_kernels(precision: Precision) -> KernelSet:
    """Make (once) the kernels of batched conjugate gradients in a precision; the last index of each is a lane."""
    scalar, vec3 = precision.scalar, precision.vec3
    kernels = KernelSet(f"linear_{precision.name}_batched")
    rows = wp.constant(ROWS)
    shares_each = wp.constant(SHARES)

    @kernels.add
    def invert_diagonal(
        slots: wp.array[int],
        count: wp.array[int],
        diagonal: wp.array[int],
        values: wp.array3d[scalar],
        inverse: wp.array3d[scalar],
    ):
        """One thread for a node: the inverse of its diagonal block."""
        i, lane = wp.tid()
        if lane >= count[0]:
            return
        slot = slots[lane]
        store_symmetric(inverse, i, 0, slot, wp.inverse(block_of(values, diagonal[i], 0, slot)))

    @kernels.add
    def start(
        slots: wp.array[int],
        count: wp.array[int],
        offsets: wp.array[int],
        columns: wp.array[int],
        blocks: wp.array[int],
        values: wp.array3d[scalar],
        inverse: wp.array3d[scalar],
        v: wp.array3d[scalar],
        free: wp.array[vec3],
        x: wp.array3d[scalar],
        r: wp.array3d[scalar],
        z: wp.array3d[scalar],
        p: wp.array3d[scalar],
        shares: wp.array3d[scalar],
    ):
        """One thread for `ROWS` nodes: `b - A v` on free components, of `b` in the place of `r`, residual
        `r = b - A v - A x`, `z = D^-1 r`, `p = z`; shares of `|b - A v|^2`, `r . r` and `r . z`."""
        chunk, lane = wp.tid()
        if lane >= count[0]:
            return
        slot = slots[lane]
        bb = scalar(0.0)
        rr = scalar(0.0)
        rz = scalar(0.0)
        for i in range(chunk * rows, wp.min((chunk + 1) * rows, x.shape[0])):
            Av = row_product(offsets, columns, blocks, values, v, i, slot)
            b = vector_of(r, i, slot) - wp.cw_mul(free[i], Av)
            ri = b - row_product(offsets, columns, blocks, values, x, i, slot)
            zi = symmetric_of(inverse, i, 0, slot) * ri
            store_vector(r, i, slot, ri)
            store_vector(z, i, slot, zi)
            store_vector(p, i, slot, zi)
            bb += wp.dot(b, b)
            rr += wp.dot(ri, ri)
            rz += wp.dot(ri, zi)
        shares[0, chunk, slot] = bb
        shares[1, chunk, slot] = rr
        shares[2, chunk, slot] = rz

    @kernels.add
    def product(
        slots: wp.array[int],
        count: wp.array[int],
        offsets: wp.array[int],
        columns: wp.array[int],
        blocks: wp.array[int],
        values: wp.array3d[scalar],
        p: wp.array3d[scalar],
        q: wp.array3d[scalar],
        shares: wp.array3d[scalar],
    ):
        """Likewise: `q = A p`; shares of `p . q`."""
        chunk, lane = wp.tid()
        if lane >= count[0]:
            return
        slot = slots[lane]
        pq = scalar(0.0)
        for i in range(chunk * rows, wp.min((chunk + 1) * rows, p.shape[0])):
            qi = row_product(offsets, columns, blocks, values, p, i, slot)
            store_vector(q, i, slot, qi)
            pq += wp.dot(vector_of(p, i, slot), qi)
        shares[0, chunk, slot] = pq

    @kernels.add
    def advance(
        slots: wp.array[int],
        count: wp.array[int],
        alpha: wp.array[scalar],
        inverse: wp.array3d[scalar],
        p: wp.array3d[scalar],
        q: wp.array3d[scalar],
        x: wp.array3d[scalar],
        r: wp.array3d[scalar],
        z: wp.array3d[scalar],
        shares: wp.array3d[scalar],
    ):
        """Likewise: `x += alpha p`, `r -= alpha q`, `z = D^-1 r`; shares of `r . r` and `r . z`."""
        chunk, lane = wp.tid()
        if lane >= count[0]:
            return
        slot = slots[lane]
        a = alpha[slot]
        rr = scalar(0.0)
        rz = scalar(0.0)
        for i in range(chunk * rows, wp.min((chunk + 1) * rows, x.shape[0])):
            store_vector(x, i, slot, vector_of(x, i, slot) + a * vector_of(p, i, slot))
            ri = vector_of(r, i, slot) - a * vector_of(q, i, slot)
            zi = symmetric_of(inverse, i, 0, slot) * ri
            store_vector(r, i, slot, ri)
            store_vector(z, i, slot, zi)
            rr += wp.dot(ri, ri)
            rz += wp.dot(ri, zi)
        shares[0, chunk, slot] = rr
        shares[1, chunk, slot] = rz

    @kernels.add
    def turn(
        slots: wp.array[int],
        count: wp.array[int],
        beta: wp.array[scalar],
        z: wp.array3d[scalar],
        p: wp.array3d[scalar],
    ):
        """Likewise: `p = z + beta p`."""
        chunk, lane = wp.tid()
        if lane >= count[0]:
            return
        slot = slots[lane]
        b = beta[slot]
        for i in range(chunk * rows, wp.min((chunk + 1) * rows, p.shape[0])):
            store_vector(p, i, slot, vector_of(z, i, slot) + b * vector_of(p, i, slot))

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

    @kernels.add
    def finish_start(
        slots: wp.array[int],
        count: wp.array[int],
        sums: wp.array3d[scalar],
        tolerance: scalar,
        goal: wp.array[scalar],
        rr: wp.array[scalar],
        rz: wp.array[scalar],
        iterations: wp.array[int],
        solving: wp.array[int],
    ):
        """Third stage, one thread for a sample: its scalars, and whether it goes on."""
        lane = wp.tid()
        if lane >= count[0]:
            return
        slot = slots[lane]
        goal[slot] = tolerance * tolerance * total_of(sums, 0, slot)
        rr[slot] = total_of(sums, 1, slot)
        rz[slot] = total_of(sums, 2, slot)
        iterations[slot] = 0
        solving[slot] = 0
        # written so that a residual that is not a number is the end
        if rr[slot] > goal[slot]:
            solving[slot] = 1

    @kernels.add
    def finish_product(
        slots: wp.array[int],
        count: wp.array[int],
        sums: wp.array3d[scalar],
        rz: wp.array[scalar],
        alpha: wp.array[scalar],
    ):
        lane = wp.tid()
        if lane >= count[0]:
            return
        slot = slots[lane]
        alpha[slot] = rz[slot] / total_of(sums, 0, slot)

    @kernels.add
    def finish_advance(
        slots: wp.array[int],
        count: wp.array[int],
        sums: wp.array3d[scalar],
        max_iterations: int,
        goal: wp.array[scalar],
        rr: wp.array[scalar],
        rz: wp.array[scalar],
        beta: wp.array[scalar],
        iterations: wp.array[int],
        solving: wp.array[int],
    ):
        lane = wp.tid()
        if lane >= count[0]:
            return
        slot = slots[lane]
        new = total_of(sums, 1, slot)
        beta[slot] = new / rz[slot]
        rz[slot] = new
        rr[slot] = total_of(sums, 0, slot)
        iterations[slot] = iterations[slot] + 1
        if not (rr[slot] > goal[slot]) or iterations[slot] >= max_iterations:
            solving[slot] = 0

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

    return kernels
