"""Which elements a block of threads assembles, and in what order: tables for `batched.patch_assembly`.

A patch is a region of the mesh, found by recursive bisection of the elements' centres, so small that the matrix of its
elements fits into the shared memory of a block of threads: the blocks between its nodes, all but those on the diagonal,
which are minus the sum of the others in their row. Its elements are dealt out to rounds. No two elements of a round
share an edge, so that threads add what they have of a round to the matrix at the same time, and in an order that
depends on the mesh alone.

A pair of nodes that elements of several patches share has a row of the matrix for the first of them, and one among
others behind it for each further one, which are added up afterwards.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Bools, Floats
from warpbrain.errors import InputError
from warpbrain.kernels.batched.parts import Ints, bisected, integers

#: Local nodes of the six edges of an element.
EDGES = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
#: Edges of a node that a thread reads at a time; `Patches.spokes` are these edges.
SPOKES = 4
#: In `Patches.kept`, behind nine bits: to this row of a node's diagonal block its mass is added, or 1 if it is held.
FIRST = 1 << 9


@dataclass(frozen=True)
class Patches:
    """Tables of the patches of some elements.

    Rows of a patch are those of its edges and behind them those of its nodes.
    """

    elements: Ints  # (patches, rounds, width), -1 where there is none
    corners: Ints  # (patches, rounds, width, 4), places of their nodes in the patch
    #: (patches, rounds, width, 6), places of their edges; where there is no element, one behind those of the patch.
    edges: Ints
    round_counts: Ints  # (patches,), a multiple of those together
    edge_counts: Ints  # (patches,)
    node_starts: Ints  # of each patch
    nodes: Ints
    #: Edges of each node of a patch, ``-1 - edge`` where the node is the second of the two. They are a multiple of
    #: `SPOKES`: there are some at the end that are one behind those of the patch.
    spoke_starts: Ints
    spokes: Ints
    #: Row of the matrix of each row of a patch, and bits ``3 r + c`` of what is free in it; and `FIRST`.
    row_starts: Ints
    rows: Ints
    kept: Ints


@dataclass(frozen=True)
class Sums:
    """What is to be added up: to the row `pairs[i]` the rows `extra_starts[i]` to `extra_starts[i + 1]` of others."""

    pairs: Ints
    extra_starts: Ints

    @property
    def extras(self) -> int:
        """How many others there are."""
        return int(self.extra_starts[-1])


def rounds_of(edges: Ints, width: int) -> list[list[int]]:
    """Elements (k, 6) of edges in rounds of at most `width`, of which no two share an edge."""
    shared = np.bincount(edges.ravel())[edges]
    # what is hardest to place first
    order = np.lexsort((-shared.sum(axis=1), -shared.max(axis=1)))
    least = max(int(shared.max()), -(-len(edges) // width))
    taken = np.zeros((len(edges), edges.max() + 1), dtype=bool)
    filled = np.zeros(len(edges), dtype=int)
    rounds: list[list[int]] = [[] for _ in edges]
    for element in order.tolist():
        possible = np.flatnonzero((filled[:least] < width) & ~np.any(taken[:least, edges[element]], axis=1))
        if not len(possible):
            possible = np.array([least])
            least += 1
        place = possible[np.argmin(filled[possible])]
        taken[place, edges[element]] = True
        filled[place] += 1
        rounds[place].append(element)
    return rounds[:least]


def patches_of(
    points: Floats,
    tetrahedra: Ints,
    pairs: Ints,
    free: Bools,
    groups: Sequence[NDArray[np.intp]],
    width: int,
    together: int,
    fits: Callable[[int, int], bool],
) -> tuple[list[Patches], Sums]:
    """Share out elements (m, 4) of nodes that ascend, whose matrix has blocks of `pairs` (p, 2) that ascend.

    Each of `groups` of elements has patches of its own, of as many edges and nodes as there is room for (`fits`), in
    rounds of `width` elements, of which so many are `together`. `free` (n, 3) are the components that are.
    """
    keys = pairs[:, 0].astype(np.int64) * len(points) + pairs[:, 1]
    first, second = tetrahedra[:, np.array(EDGES)].astype(np.int64).transpose(2, 0, 1)
    of_edges = integers(np.searchsorted(keys, first * len(points) + second))
    is_diagonal = pairs[:, 0] == pairs[:, 1]
    of_nodes = np.flatnonzero(is_diagonal)
    parted = [_parted(points, tetrahedra, of_edges, group, fits) for group in groups]
    # of each patch, one group after the other: its edges and nodes, as pairs
    of_patches = [
        np.concatenate([np.unique(of_edges[piece]), of_nodes[np.unique(tetrahedra[piece])]])
        for pieces in parted
        for piece in pieces
    ]
    listed = np.concatenate(of_patches)
    rows, firsts, sums = _rows_of(listed, len(pairs))
    bits = free[pairs[:, 0]][:, :, None] & free[pairs[:, 1]][:, None, :]
    kept = (bits.reshape(-1, 9) @ (1 << np.arange(9)))[listed] + FIRST * (firsts & is_diagonal[listed])
    starts = np.cumsum([0, *map(len, of_patches)])
    made = []
    for pieces in parted:
        mine, starts = starts[: len(pieces) + 1], starts[len(pieces) :]
        span = slice(mine[0], mine[-1])
        made.append(_tables(pieces, tetrahedra, of_edges, pairs, width, together, mine, rows[span], kept[span]))
    return made, sums


def _parted(
    points: Floats, tetrahedra: Ints, edges: Ints, group: NDArray[np.intp], fits: Callable[[int, int], bool]
) -> list[NDArray[np.intp]]:
    """The elements of each patch: the fewest, of a power of two, that all have room; `InputError` if not one has."""
    if not fits(len(EDGES), 4):
        raise InputError("device: a block of its threads has no room for one element: expected another GPU, or the CPU")
    parts, centres = 1, points[tetrahedra[group]].mean(axis=1)
    while True:
        part = bisected(centres, np.ones(len(group), dtype=np.int32), parts)
        pieces = [group[part == number] for number in range(parts) if np.any(part == number)]
        if all(fits(len(np.unique(edges[piece])), len(np.unique(tetrahedra[piece]))) for piece in pieces):
            return pieces
        parts *= 2


def _rows_of(listed: Ints, pairs: int) -> tuple[Ints, Bools, Sums]:
    """Row of each of the pairs that patches have, whether it is the pair's own, and what is to be added up."""
    order = np.argsort(listed, kind="stable")
    copies = np.bincount(listed, minlength=pairs)
    rank = np.empty(len(listed), dtype=np.int64)
    rank[order] = np.arange(len(listed)) - np.repeat(np.cumsum(copies) - copies, copies)
    shared = np.flatnonzero(copies > 1)
    starts = np.r_[0, np.cumsum(copies[shared] - 1)]
    extra_of = np.zeros(pairs, dtype=np.int64)
    extra_of[shared] = starts[:-1]
    rows = np.where(rank == 0, listed, pairs + extra_of[listed] + rank - 1)
    return integers(rows), np.asarray(rank == 0), Sums(integers(shared), integers(starts))


def _tables(
    pieces: list[NDArray[np.intp]],
    tetrahedra: Ints,
    of_edges: Ints,
    pairs: Ints,
    width: int,
    together: int,
    starts: NDArray[np.intp],
    rows: Ints,
    kept: Ints,
) -> Patches:
    edges = [np.unique(of_edges[piece], return_inverse=True) for piece in pieces]
    nodes = [np.unique(tetrahedra[piece], return_inverse=True) for piece in pieces]
    rounds = [rounds_of(integers(inverse.reshape(-1, 6)), width) for _, inverse in edges]
    turns = [-(-len(of) // together) * together for of in rounds]
    elements = np.full((len(pieces), max(turns), width), -1)
    corners = np.zeros((*elements.shape, 4), dtype=np.int32)
    at = np.empty((*elements.shape, 6), dtype=np.int32)
    counts, spokes = [], []
    for patch, piece in enumerate(pieces):
        (patch_edges, edge), (patch_nodes, corner) = edges[patch], nodes[patch]
        count_of_edges = len(patch_edges)
        at[patch] = count_of_edges
        for turn, chosen in enumerate(rounds[patch]):
            elements[patch, turn, : len(chosen)] = piece[chosen]
            corners[patch, turn, : len(chosen)] = corner.reshape(-1, 4)[chosen]
            at[patch, turn, : len(chosen)] = edge.reshape(-1, 6)[chosen]
        at_ends = np.searchsorted(patch_nodes, pairs[patch_edges])
        all_ends = np.r_[at_ends[:, 0], at_ends[:, 1]]
        count = np.bincount(all_ends, minlength=len(patch_nodes))
        counts.append(-(-count // SPOKES) * SPOKES)
        order = np.argsort(all_ends, kind="stable")
        # where those of each node begin with and without what is added at the end
        shift = np.cumsum(counts[-1]) - counts[-1] - np.cumsum(count) + count
        spokes.append(np.full(counts[-1].sum(), count_of_edges))
        spokes[-1][np.arange(len(order)) + np.repeat(shift, count)] = np.r_[
            np.arange(count_of_edges), -1 - np.arange(count_of_edges)
        ][order]
    return Patches(
        integers(elements), corners, at, integers(turns),
        integers([len(of_patch) for of_patch, _ in edges]),
        integers(np.cumsum([0, *(len(of_patch) for of_patch, _ in nodes)])),
        integers(np.concatenate([of_patch for of_patch, _ in nodes])),
        integers(np.r_[0, np.cumsum(np.concatenate(counts))]), integers(np.concatenate(spokes)),
        integers(starts - starts[0]), rows, integers(kept),
    )  # fmt: skip
