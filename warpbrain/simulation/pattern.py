"""The sparsity pattern of the system, made once for a mesh: who contributes to which block and to which node."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int32]


@dataclass(frozen=True)
class Pattern:
    """Pattern of a symmetric block matrix over nodes, and the lists that fill it.

    What acts is a number of families of stencils: the four nodes of every tetrahedron, the three of every triangle that
    a pressure acts on. A stencil of s nodes has s forces and s (s + 1) / 2 blocks, those of its node pairs (a, b),
    a <= b, row by row. Forces and blocks of all families lie one after the other in one array each.

    Attributes
    ----------
    offsets : (n + 1,) int
        Start of each block row in `columns`.
    columns : (nnz,) int
        Block column of each stored block, ascending within a row.
    diagonal : (n,) int
        Position of each diagonal block.
    block_pairs : (nnz,) int
        Pair whose block is stored there, or -1 - pair where its transpose is.
    pairs : (p, 2) int
        Node pairs i <= j that share a stencil.
    positions : (p, 2) int
        Positions of the blocks (i, j) and (j, i) of each pair.
    first : (p + 1,) int
        Start of each pair's list in `contributions`.
    contributions : (b,) int
        Stencil blocks that add up to the pair's block, ascending.
    corner_first : (n + 1,) int
        Start of each node's list in `corners`.
    corners : (c,) int
        Stencil forces on the node, ascending.
    """

    offsets: Ints
    columns: Ints
    diagonal: Ints
    block_pairs: Ints
    pairs: Ints
    positions: Ints
    first: Ints
    contributions: Ints
    corner_first: Ints
    corners: Ints


def build_pattern(stencils: Sequence[NDArray[np.integer]], count: int) -> Pattern:
    """Make the pattern of families of stencils.

    Parameters
    ----------
    stencils : sequence of (k, s) int arrays
        Node ids, ascending in each row, so that every block of a pair (a, b), a <= b, belongs to nodes i <= j.
    count : int
        Number of nodes; each must be in a stencil.
    """
    keys = []
    for nodes in stencils:
        a, b = np.triu_indices(nodes.shape[1])
        keys.append((nodes[:, a].astype(np.int64) * count + nodes[:, b]).ravel())
    key = np.concatenate(keys)
    contributions = np.argsort(key, kind="stable")
    key = key[contributions]
    first = np.flatnonzero(np.r_[True, key[1:] != key[:-1]])
    i, j = np.divmod(key[first], count)

    mirrored = np.flatnonzero(i != j)
    rows, columns = np.r_[i, j[mirrored]], np.r_[j, i[mirrored]]
    order = np.argsort(rows * count + columns, kind="stable")
    block_pairs = np.r_[np.arange(len(i)), -1 - mirrored][order]
    where = np.empty(len(order), dtype=np.int64)
    where[order] = np.arange(len(order))
    positions = np.repeat(where[: len(i), None], 2, axis=1)
    positions[mirrored, 1] = where[len(i) :]
    offsets = np.searchsorted(rows[order], np.arange(count + 1))

    all_nodes = np.concatenate([nodes.ravel() for nodes in stencils])
    corners = np.argsort(all_nodes, kind="stable")
    corner_first = np.searchsorted(all_nodes[corners], np.arange(count + 1))

    def ints(values: NDArray[np.integer]) -> Ints:
        return np.ascontiguousarray(values, dtype=np.int32)

    return Pattern(
        offsets=ints(offsets),
        columns=ints(columns[order]),
        diagonal=ints(positions[i == j, 0]),
        block_pairs=ints(block_pairs),
        pairs=ints(np.stack([i, j], axis=1)),
        positions=ints(positions),
        first=ints(np.r_[first, len(key)]),
        contributions=ints(contributions),
        corner_first=ints(corner_first),
        corners=ints(corners),
    )
