"""What kernels know of the samples of a batch; vectors and blocks of one, whose slot is the last index of arrays."""

from collections.abc import Callable
from functools import cache
from typing import Any

import warp as wp

from warpbrain.kernels.module import KernelSet, Precision

#: Rows of the mesh that one thread works through; their share of a sum is added up on the way.
ROWS = 4
#: Shares of a sum that one thread adds up in the stage after that.
SHARES = 32
#: Numbers of an element's tangent that are stored: of ten blocks, of which the four on the diagonal are symmetric.
TANGENT = 78


def stages(rows: int) -> tuple[int, int]:
    """How many threads a sum over `rows` takes in its first and in its second stage."""
    chunks = -(-rows // ROWS)
    return chunks, -(-chunks // SHARES)


def sample_kernel(kernels: KernelSet, Samples: Any, function: Callable[..., None]) -> Any:
    """Make a kernel ``(slots, count, s)``, one thread for an item and a lane, of a function ``(item, slot, s)``."""
    of_sample = wp.func(function, inline=True)

    def kernel(slots: wp.array[int], count: wp.array[int], s: Samples):
        i, lane = wp.tid()
        if lane < count[0]:
            of_sample(i, slots[lane], s)

    kernel.__name__, kernel.__qualname__ = function.__name__, function.__qualname__
    return kernels.add(kernel)


@cache
def samples_struct(precision: Precision) -> Any:
    """Make (once) what the kernels of a precision know of the samples of a batch."""
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33

    @wp.struct
    class Samples:
        # what all of them share, as of `warpbrain.simulation.system.System`
        nodes: wp.array[wp.vec4i]
        inverse_edges: wp.array[mat33]
        volume: wp.array[scalar]
        mass: wp.array[scalar]
        free: wp.array[vec3]
        corner_first: wp.array[int]
        corners: wp.array[int]
        pairs: wp.array[wp.vec2i]
        pair_first: wp.array[int]
        contributions: wp.array[int]
        # loads and prescribed displacements at a factor of 1, their factors, and what acts in the end
        loads: wp.array2d[vec3]
        shapes: wp.array2d[vec3]
        factors: wp.array2d[scalar]
        amounts: wp.array2d[scalar]
        external: wp.array[vec3]
        # length of the step of each, and coefficients of stiffness and mass in its matrix
        h: wp.array[scalar]
        k: wp.array[scalar]
        m: wp.array[scalar]
        # state now and at the start of the step, the change of velocity, and the velocity of constrained components
        u: wp.array3d[wp.float64]
        u_start: wp.array3d[wp.float64]
        v: wp.array3d[scalar]
        v_start: wp.array3d[scalar]
        dv: wp.array3d[scalar]
        prescribed: wp.array3d[scalar]
        # the force of an element on its corner `a` is in row ``4 e + a``
        internal: wp.array3d[scalar]
        element_forces: wp.array3d[scalar]
        element_J: wp.array2d[scalar]
        tangents: wp.array3d[scalar]
        # shares of two squared norms
        shares: wp.array3d[scalar]
        # the linear systems, and whether each is being solved
        values: wp.array3d[scalar]
        b: wp.array3d[scalar]
        solving: wp.array[int]

    return Samples


@wp.func
def vector_of(x: wp.array3d[Any], i: int, slot: int):
    """Vector `i` of a sample."""
    return wp.vector(x[i, 0, slot], x[i, 1, slot], x[i, 2, slot])


@wp.func
def narrowed(x: wp.vec3d, like: wp.array3d[Any]):
    """A vector in the precision of others."""
    return wp.vector(like.dtype(x[0]), like.dtype(x[1]), like.dtype(x[2]))


@wp.func
def widened(x: Any):
    """A vector in double precision."""
    return wp.vec3d(wp.float64(x[0]), wp.float64(x[1]), wp.float64(x[2]))


@wp.func
def store_vector(x: wp.array3d[Any], i: int, slot: int, value: Any):
    """Set vector `i` of a sample."""
    x[i, 0, slot] = value[0]
    x[i, 1, slot] = value[1]
    x[i, 2, slot] = value[2]


@wp.func
def block_of(blocks: wp.array3d[Any], i: int, at: int, slot: int):
    """Block of a sample whose numbers begin at `at` in row `i`."""
    return wp.matrix_from_rows(
        wp.vector(blocks[i, at, slot], blocks[i, at + 1, slot], blocks[i, at + 2, slot]),
        wp.vector(blocks[i, at + 3, slot], blocks[i, at + 4, slot], blocks[i, at + 5, slot]),
        wp.vector(blocks[i, at + 6, slot], blocks[i, at + 7, slot], blocks[i, at + 8, slot]),
    )


@wp.func
def store_block(blocks: wp.array3d[Any], i: int, at: int, slot: int, value: Any):
    """Set it."""
    for r in range(3):
        for c in range(3):
            blocks[i, at + 3 * r + c, slot] = value[r, c]


@wp.func
def symmetric_of(blocks: wp.array3d[Any], i: int, at: int, slot: int):
    """Likewise, a symmetric block, of which the six entries on and above the diagonal are kept."""
    xy = blocks[i, at + 1, slot]
    xz = blocks[i, at + 2, slot]
    yz = blocks[i, at + 4, slot]
    return wp.matrix_from_rows(
        wp.vector(blocks[i, at, slot], xy, xz),
        wp.vector(xy, blocks[i, at + 3, slot], yz),
        wp.vector(xz, yz, blocks[i, at + 5, slot]),
    )


@wp.func
def store_symmetric(blocks: wp.array3d[Any], i: int, at: int, slot: int, value: Any):
    """Set it."""
    blocks[i, at, slot] = value[0, 0]
    blocks[i, at + 1, slot] = value[0, 1]
    blocks[i, at + 2, slot] = value[0, 2]
    blocks[i, at + 3, slot] = value[1, 1]
    blocks[i, at + 4, slot] = value[1, 2]
    blocks[i, at + 5, slot] = value[2, 2]


@wp.func
def store_tangent(
    tangents: wp.array3d[Any], e: int, slot: int, K11: Any, K12: Any, K13: Any, K22: Any, K23: Any, K33: Any
):
    """Set the tangent of an element of a sample from its blocks of nodes 1 to 3: each row of blocks sums to zero."""
    K01 = -(K11 + wp.transpose(K12) + wp.transpose(K13))
    K02 = -(K12 + K22 + wp.transpose(K23))
    K03 = -(K13 + K23 + K33)
    store_block(tangents, e, 0, slot, K01)
    store_block(tangents, e, 9, slot, K02)
    store_block(tangents, e, 18, slot, K03)
    store_block(tangents, e, 27, slot, K12)
    store_block(tangents, e, 36, slot, K13)
    store_block(tangents, e, 45, slot, K23)
    store_symmetric(tangents, e, 54, slot, -(K01 + K02 + K03))
    store_symmetric(tangents, e, 60, slot, K11)
    store_symmetric(tangents, e, 66, slot, K22)
    store_symmetric(tangents, e, 72, slot, K33)


@wp.func
def tangent_of(tangents: wp.array3d[Any], e: int, k: int, slot: int):
    """Block `k` of the ten of `warpbrain.kernels.tetrahedron.PAIRS`."""
    if k == 0 or k == 4 or k == 7 or k == 9:
        # of nodes 0 to 3
        return symmetric_of(tangents, e, 54 + 6 * (k / 3), slot)
    at = 9 * k - 9
    if k > 4:
        at = 9 * k - 18
    if k > 7:
        at = 45
    return block_of(tangents, e, at, slot)
