"""Who has which part of a sparse matrix in a cluster of blocks of threads: tables for `batched.cluster`.

Each block has the rows of a region of the mesh, found by recursive bisection across its longest side: few of its
neighbours are elsewhere. The 3 x 3 blocks of its rows, one row after the other, are dealt out in runs of the same
length to its threads: a thread has `places`. Where a run has the end of a row, or its own, its thread leaves what it
has summed up until there, a segment; the segments of a row are one behind the other.

The blocks of a segment may have any order. Theirs is such that threads beside each other, which read numbers of their
columns from shared memory at the same time, find them in different banks of it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Bools, Floats

Ints = NDArray[np.int32]

#: In `Parts.columns`: the last of a segment.
ENDS = 1 << 15


@dataclass(frozen=True)
class Pattern:
    """A symmetric matrix of 3 x 3 blocks, of which those on and above the diagonal are stored, and its nodes."""

    offsets: Ints  # (n + 1,), where rows begin in the others
    columns: Ints  # of each block
    pairs: Ints  # which of the stored blocks each is, or is the transpose of
    points: Floats  # (n, 3) [m]
    active: Bools  # (n,), nodes of which not all components are held

    @property
    def rows(self) -> Ints:
        """Of each block."""
        return np.repeat(np.arange(len(self.active), dtype=np.int32), np.diff(self.offsets))

    @property
    def diagonal(self) -> Ints:
        """The stored block of each diagonal block."""
        return self.pairs[self.columns == self.rows]

    @property
    def stored(self) -> int:
        """How many blocks are stored."""
        return int(self.pairs.max()) + 1


@dataclass(frozen=True)
class Parts:
    """Tables of a pattern for `blocks` of `threads`, of which each has `places` of blocks of the matrix."""

    blocks: int
    threads: int
    places: int
    starts: Ints  # first row of each block
    nodes: Ints  # of all, block after block
    #: Nodes of other blocks that a block's rows have a column of: node, and ``block << 16 | row there``.
    outer_starts: Ints
    outer_nodes: Ints
    outer_places: Ints
    #: (blocks, threads, places), the stored block, ``-1 - pair`` where its transpose is meant; behind the last any.
    pairs: Ints
    #: (blocks, places, threads), row in the block, or behind those the place among its outer nodes; with `ENDS`.
    columns: Ints
    segment_starts: Ints  # (blocks, threads), first segment of a thread
    row_segments: Ints  # first segment of each row of a block and an end, block after block

    @property
    def rows(self) -> int:
        """The most that a block has."""
        return int(np.diff(self.starts).max())

    @property
    def outer(self) -> int:
        """Outer nodes, the most that a block has."""
        return int(np.diff(self.outer_starts).max())

    @property
    def segments(self) -> int:
        """The most that a block has."""
        return int(self.row_segments.max())


def bisected(points: Floats, weights: Ints, parts: int) -> Ints:
    """Part of each point, such that parts (a power of two) weigh about the same and are compact."""
    part = np.zeros(len(points), dtype=np.int32)
    pieces = [np.arange(len(points))]
    while len(pieces) < parts:
        halves = []
        for piece in pieces:
            axis = np.argmax(np.ptp(points[piece], axis=0))
            ordered = piece[np.argsort(points[piece, axis], kind="stable")]
            weight = np.cumsum(weights[ordered])
            half = np.searchsorted(weight, 0.5 * weight[-1])
            halves += [ordered[:half], ordered[half:]]
        pieces = halves
    for number, piece in enumerate(pieces):
        part[piece] = number
    return part


def spread_over_banks(columns: Ints, segments: Ints, banks: int) -> NDArray[np.intp]:
    """An order (threads, places) of the places of each thread, within its segments, with few conflicts of banks.

    As many threads as there are banks read at the same time: one after the other takes what is least asked for so far.
    """
    threads, places = columns.shape
    order = np.tile(np.arange(places), (threads // banks, banks, 1))
    bank = (columns % banks).reshape(order.shape)
    segment = segments.reshape(order.shape)
    groups = np.arange(len(order))
    for place in range(places):
        asked = np.zeros((len(groups), banks), dtype=int)
        for thread in range(banks):
            left, free = order[:, thread, place:], np.arange(place, places)
            cost = asked[groups[:, None], np.take_along_axis(bank[:, thread], left, axis=1)]
            cost[segment[:, thread, free] != segment[:, thread, place, None]] = banks + 1
            best = place + np.argmin(cost, axis=1)
            taken = order[groups, thread, best]
            order[groups, thread, best] = order[:, thread, place]
            order[:, thread, place] = taken
            asked[groups, bank[groups, thread, taken]] += 1
    return order.reshape(threads, places)


def parts_of(pattern: Pattern, blocks: int, threads: int, banks: int) -> Parts:
    """Share out a matrix, of whose numbers `banks` are read from shared memory at a time; `threads` are a multiple.

    There must be at least as many active nodes as blocks.
    """
    offsets, columns, active = pattern.offsets, pattern.columns, pattern.active
    n, rows = len(active), pattern.rows
    counted = active[rows] & active[columns]
    lengths = integers(np.bincount(rows[counted], minlength=n))
    ids = np.flatnonzero(active)
    part = np.full(n, -1)
    part[ids] = bisected(pattern.points[ids], lengths[ids], blocks)
    members = [ids[part[ids] == block] for block in range(blocks)]
    row_of = np.zeros(n, dtype=int)
    for nodes in members:
        row_of[nodes] = np.arange(len(nodes))
    places = int(-(-max(lengths[nodes].sum() for nodes in members) // threads))

    pairs = np.zeros((blocks, threads * places), dtype=np.int32)
    local = np.zeros((blocks, threads * places), dtype=np.int32)
    segment_starts = np.zeros((blocks, threads), dtype=np.int32)
    outer, row_segments = [], []
    for block, nodes in enumerate(members):
        # of these rows, one after the other
        entries = np.concatenate([np.arange(offsets[i], offsets[i + 1]) for i in nodes])
        entries = entries[counted[entries]]
        here, size = columns[entries], len(entries)
        outer.append(np.unique(here[part[here] != block]))
        place = row_of.copy()
        place[outer[-1]] = len(nodes) + np.arange(len(outer[-1]))
        row_ends = np.cumsum(lengths[nodes]) - 1
        ends = np.zeros(threads * places, dtype=bool)
        ends[places - 1 :: places] = True
        ends[row_ends] = True
        ends[size:] = False
        pairs[block, :size] = np.where(here < rows[entries], -1 - pattern.pairs[entries], pattern.pairs[entries])
        local[block, :size] = place[here]
        ended = np.cumsum(ends)
        order = spread_over_banks(local[block].reshape(threads, places), (ended - ends).reshape(threads, places), banks)
        order = (order + places * np.arange(threads)[:, None]).ravel()
        pairs[block], local[block] = pairs[block, order], local[block, order] + ENDS * ends
        segment_starts[block, 1:] = ended[places - 1 : -1 : places]
        row_segments += [0, *ended[row_ends]]
    return Parts(
        blocks,
        threads,
        places,
        _starts(members),
        integers(np.concatenate(members)),
        _starts(outer),
        integers(np.concatenate(outer)),
        integers(np.concatenate([part[nodes] << 16 | row_of[nodes] for nodes in outer])),
        pairs.reshape(blocks, threads, places),
        np.ascontiguousarray(local.reshape(blocks, threads, places).transpose(0, 2, 1)),
        segment_starts,
        integers(row_segments),
    )


def _starts(lists: list[NDArray[np.int_]]) -> Ints:
    return integers(np.cumsum([0, *map(len, lists)]))


def integers(values: object) -> Ints:
    """As 32-bit ones."""
    return np.asarray(values, dtype=np.int32)
