"""Nested dissection of a body: in which order its nodes are eliminated, and what each elimination reaches.

A body is cut in two by nodes that are eliminated after both halves, these in the same way, and so on (George 1973, SIAM
J. Numer. Anal. 10, 345). Cuts are planes across the principal axes; of the three the one with the fewest nodes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]

#: Nodes that are eliminated together without a cut.
_WHOLE = 60


@dataclass(frozen=True, eq=False)
class Front:
    """Nodes that are eliminated together.

    Attributes
    ----------
    own : (p,) int array
        Nodes, by their ids.
    reached : (q,) int array
        Nodes eliminated later that these touch, by their places in the order, ascending.
    parts : tuple of int
        Fronts whose elimination leaves something on these nodes.
    """

    own: Ints
    reached: Ints
    parts: tuple[int, ...]


def dissected(graph: Any, places: Floats) -> list[Front]:
    """Fronts in the order of elimination.

    Parameters
    ----------
    graph : SciPy CSR (n, n)
        Which nodes touch, symmetric.
    places : (n, 3) array
        Where they are; that decides only how much is to do.
    """
    groups: list[tuple[Ints, tuple[int, ...]]] = []
    _cut(graph, places, np.arange(len(places)), groups)
    at = np.empty(len(places), dtype=np.intp)
    at[np.concatenate([own for own, _ in groups])] = np.arange(len(places))
    fronts: list[Front] = []
    done = 0
    for own, parts in groups:
        done += len(own)
        touched = [at[graph[own].indices], *(fronts[part].reached for part in parts)]
        reached = np.unique(np.concatenate(touched))
        fronts.append(Front(own, reached[reached >= done], parts))
    return fronts


def _cut(graph: Any, places: Floats, nodes: Ints, groups: list[tuple[Ints, tuple[int, ...]]]) -> int:
    """Add the groups of some nodes, the one that is eliminated last at the end; its number."""
    found = None if len(nodes) <= _WHOLE else _separator(graph[nodes][:, nodes], places[nodes])
    parts: tuple[int, ...] = ()
    own = nodes
    if found is not None:
        lower, between = found
        halves = (nodes[lower & ~between], nodes[~lower & ~between])
        parts = tuple(_cut(graph, places, half, groups) for half in halves if len(half))
        own = nodes[between]
    groups.append((own, parts))
    return len(groups) - 1


def _separator(graph: Any, places: Floats) -> tuple[NDArray[np.bool_], NDArray[np.bool_]] | None:
    """Which nodes are on the lower side of a plane, and which of the nodes are cut out; None if no plane divides."""
    from_middle = places - places.mean(axis=0)
    axes = np.linalg.eigh(from_middle.T @ from_middle)[1].T
    best: tuple[int, NDArray[np.bool_], NDArray[np.bool_]] | None = None
    for axis in axes:
        along = from_middle @ axis
        lower = along < np.median(along)
        for side in (lower, ~lower):
            between = side & ((graph @ (~side).astype(np.float64)) > 0.0)
            size = int(between.sum())
            if size > 0 and (best is None or size < best[0]) and (side & ~between).any():
                best = size, lower, between
    return None if best is None else best[1:]
