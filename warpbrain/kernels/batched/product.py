"""A row of the product of a symmetric matrix and a vector, of which the blocks on and above the diagonal are kept."""

from typing import Any

import warp as wp

from warpbrain.kernels.batched.layout import block_of, vector_of


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
