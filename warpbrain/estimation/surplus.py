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

from warpbrain.arrays import Floats, Int32s
from warpbrain.mesh.refinement import edge_numbers
from warpbrain.mesh.surface import EDGES


@dataclass(frozen=True, eq=False)
class Surplus:
    """The hierarchical surplus of the displacement of a state, or of several states."""

    edges: Int32s  # (E, 2), nodes at the ends of each edge of the mesh, ascending; edges in lexicographic order
    values: Floats  # (..., E, 3), displacement of its middle less the mean of that of its ends [m]

    @classmethod
    def of(cls, edges: Int32s, u: Floats) -> Surplus:
        """That of a displacement [m] of the nodes and then of the middles of edges: (..., N + E, 3)."""
        return cls(edges, u[..., u.shape[-2] - len(edges) :, :] - _means(edges, u))

    def with_middles(self, u: Floats) -> Floats:
        """Displacement (..., N + E, 3) of nodes and of middles of edges, by that of nodes (..., N, 3) [m]."""
        return np.concatenate([u, _means(self.edges, u) + self.values], axis=-2)

    def plus(self, other: Surplus) -> Surplus:
        return replace(self, values=self.values + other.values)

    def times(self, factor: float) -> Surplus:
        return replace(self, values=factor * self.values)


def _means(edges: Int32s, u: Floats) -> Floats:
    """Mean displacement (..., E, 3) [m] of the ends of edges."""
    return np.asarray(0.5 * (u[..., edges[:, 0], :] + u[..., edges[:, 1], :]))


def rows_by_surplus(by_displacement: Any, edges: Int32s) -> Any:
    """The SciPy CSR matrix (n, 3 E) from a surplus [m] to recorded rows, each of one point and one direction.

    `by_displacement`: SciPy CSR (n, 3 N), from the displacement of nodes [m] to the same rows; rows of forces are
    zero. `edges` (E, 2): as of `Surplus`.
    """
    from scipy.sparse import coo_array, csr_array

    B, (count, size) = by_displacement.tocoo(), by_displacement.shape
    components = B.col % 3
    # barycentric coordinates sum to one: what is left of a row is its direction
    directions = csr_array((B.data, (B.row, components)), shape=(count, 3)).toarray()
    squares = np.maximum(np.sum(directions**2, axis=1), np.finfo(float).tiny)
    coordinates = B.data * directions[B.row, components] / squares[B.row]
    of_nodes = coo_array((coordinates, (B.row, B.col // 3)), shape=(count, size // 3)).tocsr()
    corners, w = np.zeros((count, 4), dtype=np.int64), np.zeros((count, 4))
    rows = np.repeat(np.arange(count), np.diff(of_nodes.indptr))
    place = np.arange(of_nodes.nnz) - of_nodes.indptr[rows]
    corners[rows, place], w[rows, place] = of_nodes.indices, of_nodes.data
    products = 4.0 * w[:, EDGES[:, 0]] * w[:, EDGES[:, 1]]
    rows, pairs = np.nonzero(products)
    numbers = edge_numbers(edges, np.sort(corners[rows[:, None], EDGES[pairs]], axis=1), size // 3)
    shares, columns = products[rows, pairs, None] * directions[rows], 3 * numbers[:, None] + np.arange(3)
    return csr_array((shares.ravel(), (np.repeat(rows, 3), columns.ravel())), shape=(count, 3 * len(edges)))
