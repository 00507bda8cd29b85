"""Vectors and 3 x 3 blocks of a sample in arrays whose last index is the sample's slot."""

from typing import Any

import warp as wp

#: Rows of the mesh that one thread works through; their share of a sum is added up on the way.
ROWS = 4
#: Shares of a sum that one thread adds up in the stage after that.
SHARES = 32


def stages(rows: int) -> tuple[int, int]:
    """How many threads a sum over `rows` takes in its first and in its second stage."""
    chunks = -(-rows // ROWS)
    return chunks, -(-chunks // SHARES)


@wp.func
def vector_of(x: wp.array3d[Any], i: int, slot: int):
    """Vector `i` of a sample."""
    return wp.vector(x[i, 0, slot], x[i, 1, slot], x[i, 2, slot])


@wp.func
def store_vector(x: wp.array3d[Any], i: int, slot: int, value: Any):
    """Set vector `i` of a sample."""
    x[i, 0, slot] = value[0]
    x[i, 1, slot] = value[1]
    x[i, 2, slot] = value[2]


@wp.func
def block_of(blocks: wp.array3d[Any], i: int, slot: int):
    """Block `i` of a sample."""
    return wp.matrix_from_rows(
        wp.vector(blocks[i, 0, slot], blocks[i, 1, slot], blocks[i, 2, slot]),
        wp.vector(blocks[i, 3, slot], blocks[i, 4, slot], blocks[i, 5, slot]),
        wp.vector(blocks[i, 6, slot], blocks[i, 7, slot], blocks[i, 8, slot]),
    )


@wp.func
def store_block(blocks: wp.array3d[Any], i: int, slot: int, value: Any):
    """Set block `i` of a sample."""
    for r in range(3):
        for c in range(3):
            blocks[i, 3 * r + c, slot] = value[r, c]


@wp.func
def symmetric_of(blocks: wp.array3d[Any], i: int, slot: int):
    """Symmetric block `i` of a sample, of which the six entries on and above the diagonal are kept."""
    xy = blocks[i, 1, slot]
    xz = blocks[i, 2, slot]
    yz = blocks[i, 4, slot]
    return wp.matrix_from_rows(
        wp.vector(blocks[i, 0, slot], xy, xz),
        wp.vector(xy, blocks[i, 3, slot], yz),
        wp.vector(xz, yz, blocks[i, 5, slot]),
    )


@wp.func
def store_symmetric(blocks: wp.array3d[Any], i: int, slot: int, value: Any):
    """Set symmetric block `i` of a sample."""
    blocks[i, 0, slot] = value[0, 0]
    blocks[i, 1, slot] = value[0, 1]
    blocks[i, 2, slot] = value[0, 2]
    blocks[i, 3, slot] = value[1, 1]
    blocks[i, 4, slot] = value[1, 2]
    blocks[i, 5, slot] = value[2, 2]


@wp.func
def row_product(
    offsets: wp.array[int],
    columns: wp.array[int],
    blocks: wp.array[int],
    values: wp.array3d[Any],
    x: wp.array3d[Any],
    i: int,
    slot: int,
):
    """`sum_j A_ij x_j` of a sample; `blocks` says where `A_ij`, or for j < i its transpose, is kept."""
    zero = x.dtype(0.0)
    y = wp.vector(zero, zero, zero)
    for k in range(offsets[i], offsets[i + 1]):
        j = columns[k]
        A = block_of(values, blocks[k], slot)
        if j < i:
            A = wp.transpose(A)
        y += A * vector_of(x, j, slot)
    return y
