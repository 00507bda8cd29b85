"""Displacement within elements, of which linear elements know nothing: what is not linear between nodes.

In a linear element displacement is linear, in the body it is not. A node in the middle of an edge, which elements of
half the size have, moves by more than the mean of the ends: the hierarchical surplus (Yserentant 1986, Numer. Math. 49,
379). With it displacement is quadratic within an element,

    u(x) = sum_a w_a(x) u_a + sum_(a<b) 4 w_a(x) w_b(x) s_ab,      s_ab = u_ab - (u_a + u_b) / 2

`w` the barycentric coordinates of the element. The wall of a cavity, made of flat faces, moves less at its nodes, which
are its ridges, than between them: a pressure there that is fitted to nodes alone is too large.

Of a field of second order the middles of edges tell all of it; of a smooth one all but an error of third order in the
size of elements. So, unlike the error at the nodes, it is not extrapolated.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from warpbrain.arrays import Floats, Int32s, Ints
from warpbrain.mesh.surface import EDGES


@dataclass(frozen=True, eq=False)
class Surplus:
    """The surplus of a state."""

    edges: Int32s  # (E, 2), nodes at the ends of each edge of the mesh, ascending; edges in lexicographic order
    values: Floats  # (..., E, 3), displacement of its middle less the mean of that of its ends [m]

    @classmethod
    def of(cls, edges: Int32s, u: Floats) -> Surplus:
        """That of a displacement [m] of the nodes and then of the middles of edges: (N + E, 3)."""
        return cls(edges, surplus_of(edges, u))

    def with_middles(self, u: Floats) -> Floats:
        """Displacement (..., N + E, 3) of nodes and of middles of edges, by that of nodes (..., N, 3) [m]."""
        middles = 0.5 * (u[..., self.edges[:, 0], :] + u[..., self.edges[:, 1], :]) + self.values
        return np.concatenate([u, middles], axis=-2)

    def plus(self, other: Surplus) -> Surplus:
        return replace(self, values=self.values + other.values)

    def times(self, factor: float) -> Surplus:
        return replace(self, values=factor * self.values)


def surplus_of(edges: Int32s, u: Floats) -> Floats:
    """Values (..., E, 3) of a displacement (..., N + E, 3) [m]."""
    middles = u[..., u.shape[-2] - len(edges) :, :]
    return np.asarray(middles - 0.5 * (u[..., edges[:, 0], :] + u[..., edges[:, 1], :]))


@dataclass(frozen=True, eq=False)
class RowsOnEdges:
    """What n recorded rows have of the surplus."""

    count: int  # n
    rows: Ints  # (k,), numbers of rows
    edges: Ints  # (k,), numbers of edges of the elements in which these were recorded
    weights: Floats  # (k, 3), by which the surplus of each component counts

    @classmethod
    def of(cls, by_displacement: Any, edges: Int32s) -> RowsOnEdges:
        """Of rows that a SciPy CSR matrix (n, 3 N) takes from displacement, each of one point and one direction.

        `edges` (E, 2): as of `Surplus`.
        """
        from scipy.sparse import coo_array

        B, count = by_displacement.tocoo(), by_displacement.shape[0]
        nodes, components = B.col // 3, B.col % 3
        directions = np.zeros((count, 3))
        # barycentric coordinates sum to one
        np.add.at(directions, (B.row, components), B.data)
        squares = np.maximum(np.sum(directions**2, axis=1), np.finfo(float).tiny)
        shares = B.data * directions[B.row, components] / squares[B.row]
        of_nodes = coo_array((shares, (B.row, nodes)), shape=(count, by_displacement.shape[1] // 3)).tocsr()
        of_nodes.sum_duplicates()
        at, members = np.diff(of_nodes.indptr), np.repeat(np.arange(count), np.diff(of_nodes.indptr))
        place = np.arange(of_nodes.nnz) - np.repeat(of_nodes.indptr[:-1], at)
        corners, w = np.zeros((count, 4), dtype=np.int64), np.zeros((count, 4))
        corners[members, place], w[members, place] = of_nodes.indices, of_nodes.data
        products = 4.0 * w[:, EDGES[:, 0]] * w[:, EDGES[:, 1]]
        rows, pairs = np.nonzero(products)
        ends = np.sort(corners[rows[:, None], EDGES[pairs]], axis=1)
        key = np.array([by_displacement.shape[1] // 3, 1])
        numbers = np.searchsorted(edges.astype(np.int64) @ key, ends @ key)
        return cls(count, rows, numbers, products[rows, pairs, None] * directions[rows])

    def answers(self, values: Floats) -> Floats:
        """Change (n, p) of what is computed by the surplus (p, E, 3)."""
        each = np.einsum("kc,pkc->kp", self.weights, values[:, self.edges])
        total = np.zeros((self.count, len(values)))
        np.add.at(total, self.rows, each)
        return total
