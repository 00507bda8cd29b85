"""Kernels of implicit backward Euler: the right-hand side and the update of velocity and displacement."""

from functools import cache

import warp as wp

from warpbrain.kernels.assembly import force_on
from warpbrain.kernels.module import KernelSet
from warpbrain.kernels.precision import Precision


@cache
def dynamics_kernels(precision: Precision) -> KernelSet:
    """Make (once) the kernels of a time step in a precision, one thread for a node."""
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
