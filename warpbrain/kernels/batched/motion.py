"""Kernels of a time step of many samples, each with a step length, a time and loads of its own.

See `warpbrain.simulation.dynamics` for the equations. Displacements are in double precision whatever the others are:
that of a body that moves far has no digits to lose to the strain of its elements.
"""

from functools import cache
from typing import Any

import warp as wp

from warpbrain.kernels.batched.layout import narrowed, store_vector, vector_of, widened
from warpbrain.kernels.module import KernelSet
from warpbrain.kernels.precision import Precision


@cache
def batched_motion_kernels(precision: Precision) -> KernelSet:
    """Make (once) the batched kernels of a time step in a precision, one thread for a node and a lane."""
    scalar, vec3 = precision.scalar, precision.vec3
    kernels = KernelSet(f"motion_{precision.name}_batched")

    @kernels.add
    def restore(
        slots: wp.array[int],
        u_start: wp.array3d[wp.float64],
        v_start: wp.array3d[scalar],
        u: wp.array3d[wp.float64],
        v: wp.array3d[scalar],
        dv: wp.array3d[scalar],
    ):
        """Back to the start of the step, with no guess for its solution."""
        i, lane = wp.tid()
        slot = slots[lane]
        store_vector(u, i, slot, vector_of(u_start, i, slot))
        store_vector(v, i, slot, vector_of(v_start, i, slot))
        store_vector(dv, i, slot, vec3())

    @kernels.add
    def reset(slots: wp.array[int], u: wp.array3d[wp.float64], v: wp.array3d[scalar], dv: wp.array3d[scalar]):
        """At rest in the reference shape."""
        i, lane = wp.tid()
        slot = slots[lane]
        store_vector(u, i, slot, wp.vec3d())
        store_vector(v, i, slot, vec3())
        store_vector(dv, i, slot, vec3())

    @kernels.add
    def prescribe(
        slots: wp.array[int],
        count: wp.array[int],
        shapes: wp.array2d[vec3],
        amounts: wp.array2d[scalar],
        free: wp.array[vec3],
        h: wp.array[scalar],
        u: wp.array3d[wp.float64],
        velocity: wp.array3d[scalar],
    ):
        """Velocity of the constrained components that takes them to where they must be at the end of the step."""
        i, lane = wp.tid()
        if lane >= count[0]:
            return
        slot = slots[lane]
        goal = vec3()
        for shape in range(shapes.shape[0]):
            goal += amounts[shape, slot] * shapes[shape, i]
        held = vec3(scalar(1.0), scalar(1.0), scalar(1.0)) - free[i]
        store_vector(
            velocity, i, slot, wp.cw_mul(held, narrowed(widened(goal) - vector_of(u, i, slot), velocity) / h[slot])
        )

    @kernels.add
    def begin(
        slots: wp.array[int],
        count: wp.array[int],
        loads: wp.array2d[vec3],
        factors: wp.array2d[scalar],
        internal: wp.array3d[scalar],
        mass: wp.array[scalar],
        free: wp.array[vec3],
        h: wp.array[scalar],
        u: wp.array3d[wp.float64],
        v: wp.array3d[scalar],
        u_start: wp.array3d[wp.float64],
        v_start: wp.array3d[scalar],
        b: wp.array3d[scalar],
    ):
        """Keeps the state and writes the right-hand side `b = M v + h (f_ext - f_int)` on the free components."""
        i, lane = wp.tid()
        if lane >= count[0]:
            return
        slot = slots[lane]
        vi = vector_of(v, i, slot)
        store_vector(u_start, i, slot, vector_of(u, i, slot))
        store_vector(v_start, i, slot, vi)
        external = vec3()
        for load in range(loads.shape[0]):
            external += factors[load, slot] * loads[load, i]
        step = h[slot] * (external - vector_of(internal, i, slot))
        store_vector(b, i, slot, wp.cw_mul(free[i], mass[i] * vi + step))

    @kernels.add
    def update(
        slots: wp.array[int],
        count: wp.array[int],
        solving: wp.array[int],
        u_start: wp.array3d[wp.float64],
        v_start: wp.array3d[scalar],
        dv: wp.array3d[scalar],
        velocity: wp.array3d[scalar],
        free: wp.array[vec3],
        h: wp.array[scalar],
        v: wp.array3d[scalar],
        u: wp.array3d[wp.float64],
    ):
        """Velocity and displacement at the end of the step, of the samples whose linear solve has ended."""
        i, lane = wp.tid()
        if lane >= count[0]:
            return
        slot = slots[lane]
        if solving[slot] != 0:
            return
        prescribed = vector_of(velocity, i, slot)
        change = vector_of(v_start, i, slot) + vector_of(dv, i, slot) - prescribed
        w = wp.cw_mul(free[i], change) + prescribed
        store_vector(v, i, slot, w)
        store_vector(u, i, slot, vector_of(u_start, i, slot) + widened(h[slot] * w))

    @kernels.add
    def find_ready(
        marked: wp.array[int],
        stepping: wp.array[int],
        solving: wp.array[int],
        ready: wp.array[int],
        found: wp.array[scalar],
    ):
        """One thread for a slot: 1 where a state is to be evaluated, one that has just been reached or one that is
        marked; as a flag, and as a number to be told."""
        slot = wp.tid()
        ready[slot] = marked[slot]
        if stepping[slot] != 0 and solving[slot] == 0:
            ready[slot] = 1
        found[slot] = scalar(ready[slot])

    @kernels.add
    def collect(slots: wp.array[int], nodes: wp.array[int], x: wp.array3d[Any], collected: wp.array[wp.vec3d]):
        """One thread for a slot of a list and a node of a list: vectors of a sample side by side, as they leave the
        device."""
        place, k = wp.tid()
        collected[place * nodes.shape[0] + k] = widened(vector_of(x, nodes[k], slots[place]))

    return kernels
