"""Kernels of linear systems of displacements and of some scalars at each node; see `warpbrain.simulation.coupled`."""

from functools import cache

import warp as wp

from warpbrain.kernels.minimal_residual import node_vector
from warpbrain.kernels.module import KernelSet
from warpbrain.kernels.precision import Precision


@cache
def coupled_kernels(precision: Precision, scalars: int) -> KernelSet:
    """Make (once) the kernels of a precision and a number of scalars, which follow the displacement in a vector."""
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    vector = node_vector(precision, scalars)
    count = wp.constant(scalars)
    kernels = KernelSet(f"coupled_{scalars}_{precision.name}")

    @wp.func
    def displacement(x: vector):
        return vec3(x[0], x[1], x[2])

    @wp.func
    def with_displacement(d: vec3):
        x = vector()
        for c in range(3):
            x[c] = d[c]
        return x

    @kernels.add
    def multiply(
        offsets: wp.array[int],
        columns: wp.array[int],
        values: wp.array[mat33],
        x: wp.array[vector],
        y: wp.array[vector],
    ):
        """`y = K x` of displacements, zero for scalars; one thread for a node, as in all of these."""
        i = wp.tid()
        f = vec3()
        for k in range(offsets[i], offsets[i + 1]):
            f += values[k] * displacement(x[columns[k]])
        y[i] = with_displacement(f)

    @kernels.add
    def couple(
        place: int,
        offsets: wp.array[int],
        columns: wp.array[int],
        compliance: wp.array[scalar],
        coupling: wp.array[vec3],
        transposed: wp.array[vec3],
        free: wp.array[vec3],
        root: wp.array[scalar],
        x: wp.array[vector],
        y: wp.array[vector],
    ):
        """Add to `y` what one of the scalars does to displacements, and write its own row."""
        i = wp.tid()
        pushed = vec3()
        taken = scalar(0.0)
        flow = scalar(0.0)
        for k in range(offsets[i], offsets[i + 1]):
            z = x[columns[k]]
            # constrained components of a vector that is iterated on are zero
            taken += wp.dot(coupling[k], displacement(z))
            pushed += z[place] * transposed[k]
            flow += compliance[k] * z[place]
        push = root[0] * wp.cw_mul(free[i], pushed)
        total = y[i]
        for c in range(3):
            total[c] = total[c] - push[c]
        total[place] = -root[0] * taken - flow
        y[i] = total

    @kernels.add
    def invert_coupled_diagonal(
        place: int,
        offsets: wp.array[int],
        columns: wp.array[int],
        compliance: wp.array[scalar],
        coupling: wp.array[vec3],
        free: wp.array[vec3],
        root: wp.array[scalar],
        inverse: wp.array[mat33],
        out: wp.array[vector],
    ):
        """Of one of the scalars, given the inverse diagonal blocks of `K`."""
        i = wp.tid()
        total = scalar(0.0)
        for k in range(offsets[i], offsets[i + 1]):
            j = columns[k]
            along = wp.cw_mul(free[j], coupling[k])
            total += root[0] * root[0] * wp.dot(along, inverse[j] * along)
            if j == i:
                total += compliance[k]
        diagonal = out[i]
        diagonal[place] = scalar(1.0)
        if total > scalar(0.0):
            diagonal[place] = scalar(1.0) / total
        out[i] = diagonal

    @kernels.add
    def apply_diagonal(inverse: wp.array[mat33], diagonal: wp.array[vector], x: wp.array[vector], y: wp.array[vector]):
        i = wp.tid()
        z = with_displacement(inverse[i] * displacement(x[i]))
        for place in range(3, 3 + count):
            z[place] = diagonal[i][place] * x[i][place]
        y[i] = z

    @kernels.add
    def pack(x: wp.array[vec3], y: wp.array[vector]):
        i = wp.tid()
        y[i] = with_displacement(x[i])

    @kernels.add
    def unpack(x: wp.array[vector], y: wp.array[vec3]):
        i = wp.tid()
        y[i] = displacement(x[i])

    return kernels
