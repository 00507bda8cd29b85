"""Kernels of linear systems of displacements and of a scalar at each node; see `warpbrain.simulation.coupled`."""

from functools import cache

import warp as wp

from warpbrain.kernels.minimal_residual import four_vector
from warpbrain.kernels.module import KernelSet
from warpbrain.kernels.precision import Precision


@cache
def coupled_kernels(precision: Precision) -> KernelSet:
    """Make (once) the kernels of a precision, one thread for a node; the scalar is the fourth component."""
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    vec4 = four_vector(precision)
    kernels = KernelSet(f"coupled_{precision.name}")

    @wp.func
    def displacement(x: vec4):
        return vec3(x[0], x[1], x[2])

    @kernels.add
    def multiply(
        offsets: wp.array[int],
        columns: wp.array[int],
        values: wp.array[mat33],
        own_offsets: wp.array[int],
        own_columns: wp.array[int],
        compliance: wp.array[scalar],
        own: wp.array[vec3],
        others: wp.array[vec3],
        free: wp.array[vec3],
        root: wp.array[scalar],
        x: wp.array[vec4],
        y: wp.array[vec4],
    ):
        i = wp.tid()
        f = vec3()
        for k in range(offsets[i], offsets[i + 1]):
            f += values[k] * displacement(x[columns[k]])
        pushed = vec3()
        taken = scalar(0.0)
        flow = scalar(0.0)
        for k in range(own_offsets[i], own_offsets[i + 1]):
            z = x[own_columns[k]]
            # constrained components of a vector that is iterated on are zero
            taken += wp.dot(own[k], displacement(z))
            pushed += z[3] * others[k]
            flow += compliance[k] * z[3]
        f -= root[0] * wp.cw_mul(free[i], pushed)
        y[i] = vec4(f[0], f[1], f[2], -root[0] * taken - flow)

    @kernels.add
    def invert_coupled_diagonal(
        offsets: wp.array[int],
        columns: wp.array[int],
        compliance: wp.array[scalar],
        own: wp.array[vec3],
        free: wp.array[vec3],
        root: wp.array[scalar],
        inverse: wp.array[mat33],
        out: wp.array[scalar],
    ):
        i = wp.tid()
        total = scalar(0.0)
        for k in range(offsets[i], offsets[i + 1]):
            j = columns[k]
            along = wp.cw_mul(free[j], own[k])
            total += root[0] * root[0] * wp.dot(along, inverse[j] * along)
            if j == i:
                total += compliance[k]
        out[i] = scalar(1.0)
        if total > scalar(0.0):
            out[i] = scalar(1.0) / total

    @kernels.add
    def apply_diagonal(inverse: wp.array[mat33], diagonal: wp.array[scalar], x: wp.array[vec4], y: wp.array[vec4]):
        i = wp.tid()
        f = inverse[i] * displacement(x[i])
        y[i] = vec4(f[0], f[1], f[2], diagonal[i] * x[i][3])

    @kernels.add
    def pack(x: wp.array[vec3], y: wp.array[vec4]):
        i = wp.tid()
        y[i] = vec4(x[i][0], x[i][1], x[i][2], scalar(0.0))

    @kernels.add
    def unpack(x: wp.array[vec4], y: wp.array[vec3]):
        i = wp.tid()
        y[i] = displacement(x[i])

    return kernels
