"""The sparsity pattern of the system, made once for a mesh: who contributes to which block and to which node."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.kernels.tetrahedron import PAIRS

Ints = NDArray[np.int32]


@dataclass(frozen=True)
class Pattern:
    """Pattern of a symmetric block matrix over the nodes of a mesh, and the lists that fill it.

    Attributes
    ----------
    offsets : (n + 1,) int
        Start of each block row in `columns`.
    columns : (nnz,) int
        Block column of each stored block, ascending within a row.
    diagonal : (n,) int
        Position of each diagonal block.
    pairs : (p, 2) int
        Node pairs i <= j that share an element.
    positions : (p, 2) int
        Positions of the blocks (i, j) and (j, i) of each pair.
    first : (p + 1,) int
        Start of each pair's list in `contributions`.
    contributions : (10 m,) int
        Element blocks ``10 e + k`` that add up to the pair's block, ascending.
    corner_first : (n + 1,) int
        Start of each node's list in `corners`.
    corners : (4 m,) int
        Element corners ``4 e + a`` at the node, ascending.
    """

    offsets: Ints
    columns: Ints
    diagonal: Ints
    pairs: Ints
    positions: Ints
    first: Ints
    contributions: Ints
    corner_first: Ints
    corners: Ints


def build_pattern(tetrahedra: NDArray[np.integer], count: int) -> Pattern:
    """Make the pattern of a mesh whose tetrahedra list their nodes in ascending order.

    Parameters
    ----------
    tetrahedra : (m, 4) int array
        Node ids, ascending in each row, so that every element block of a pair (a, b), a <= b, belongs to nodes i <= j.
    count : int
        Number of nodes.
    """
    a, b = np.array(PAIRS).T
    key = tetrahedra[:, a].astype(np.int64).ravel() * count + tetrahedra[:, b].ravel()
    contributions = np.argsort(key, kind="stable")
    key = key[contributions]
    first = np.flatnonzero(np.r_[True, key[1:] != key[:-1]])
    i, j = np.divmod(key[first], count)

    mirrored = np.flatnonzero(i != j)
    rows, columns = np.r_[i, j[mirrored]], np.r_[j, i[mirrored]]
    order = np.argsort(rows * count + columns, kind="stable")
    where = np.empty(len(order), dtype=np.int64)
    where[order] = np.arange(len(order))
    positions = np.repeat(where[: len(i), None], 2, axis=1)
    positions[mirrored, 1] = where[len(i) :]
    offsets = np.searchsorted(rows[order], np.arange(count + 1))

    corners = np.argsort(tetrahedra.ravel(), kind="stable")
    corner_first = np.searchsorted(tetrahedra.ravel()[corners], np.arange(count + 1))

    def ints(values: NDArray[np.integer]) -> Ints:
        return np.ascontiguousarray(values, dtype=np.int32)

    return Pattern(
        offsets=ints(offsets),
        columns=ints(columns[order]),
        diagonal=ints(positions[i == j, 0]),
        pairs=ints(np.stack([i, j], axis=1)),
        positions=ints(positions),
        first=ints(np.r_[first, len(key)]),
        contributions=ints(contributions),
        corner_first=ints(corner_first),
        corners=ints(corners),
    )
