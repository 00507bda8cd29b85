"""The body that the referee deforms: quadratic tetrahedra (FElupe's) on a mesh that is not the case's."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_matrix, csr_matrix

from referee.faces import Faces
from warpbrain.mesh import TetMesh, boundary_faces
from warpbrain.recordings.location import locate

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

#: Corners of each edge in the order in which FElupe (as VTK) numbers the middles.
SIDES = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])


@dataclass(frozen=True, eq=False)
class Pattern:
    """Blocks of a sparse matrix, and what adds up those of each pair of nodes of a tetrahedron."""

    columns: Ints
    starts: Ints
    adding: csr_matrix
    diagonal: Ints

    @classmethod
    def of(cls, cells: Ints, n: int) -> Pattern:
        """The pattern of tetrahedra (m, a) of n nodes."""
        rows, columns = np.broadcast_arrays(cells[:, :, None], cells[:, None, :])
        keys, place = np.unique(rows.ravel() * n + columns.ravel(), return_inverse=True)
        starts = np.searchsorted(keys, np.arange(n + 1) * n)
        diagonal = np.searchsorted(keys, np.arange(n) * (n + 1))
        count = len(place)
        adding = csr_matrix((np.ones(count, np.float32), (place, np.arange(count))), shape=(len(keys), count))
        return cls(keys % n, starts, adding, diagonal)

    def matrix(self, local: Floats, springs: Floats | None) -> bsr_matrix:
        """Assemble local matrices (m, a, b, 3, 3)."""
        data = (self.adding @ local.reshape(-1, 9)).reshape(-1, 3, 3)
        if springs is not None:
            data[self.diagonal] += springs
        n = len(self.starts) - 1
        return bsr_matrix((data, self.columns, self.starts), shape=(3 * n, 3 * n))


@dataclass(frozen=True, eq=False)
class Body:
    """A mesh with the middles of its edges.

    Parameters
    ----------
    mesh : TetMesh
        Corners [m], tetrahedra, tissues and sets of nodes.
    """

    mesh: TetMesh

    @cached_property
    def edges(self) -> Ints:
        """Corners of each edge, shape (k, 2), the lower number first."""
        return np.unique(self._sides.reshape(-1, 2), axis=0)

    @property
    def _sides(self) -> Ints:
        return np.sort(self.mesh.tetrahedra[:, SIDES].astype(np.int64), axis=2)

    @cached_property
    def points(self) -> Floats:
        """Corners, then middles of edges [m], shape (n, 3)."""
        corners = self.mesh.points
        return np.concatenate([corners, corners[self.edges].mean(axis=1)])

    @cached_property
    def cells(self) -> Ints:
        """Nodes of each tetrahedron, shape (m, 10)."""
        return np.concatenate([self.mesh.tetrahedra, self.middles(self._sides)], axis=1)

    def middles(self, pairs: Ints) -> Ints:
        """Numbers of the nodes between pairs of corners (..., 2)."""
        count = len(self.mesh.points)
        pairs = np.sort(pairs.astype(np.int64), axis=-1)
        keys = self.edges @ [count, 1]
        return count + np.searchsorted(keys, pairs @ [count, 1])

    @cached_property
    def _felupe(self) -> Any:
        import felupe

        return felupe.RegionQuadraticTetra(felupe.Mesh(self.points, self.cells, "tetra10"))

    @cached_property
    def region(self) -> tuple[Floats, Floats]:
        """Volumes (m, q) [m3] and places (m, q, 3) [m] of the quadrature points."""
        return np.ascontiguousarray(self._felupe.dV.T), np.einsum("aq,eai->eqi", self.shapes, self.points[self.cells])

    @cached_property
    def straight(self) -> tuple[Floats, Floats]:
        """Gradients (q, 10, 3) in the reference tetrahedron, and what makes of them those of each one (m, 3, 3) [1/m].

        Edges are straight, so that one matrix for each tetrahedron does so at all quadrature points.
        """
        reference = np.ascontiguousarray(np.transpose(self._felupe.dhdr[..., 0], (2, 0, 1)))
        return reference, np.ascontiguousarray(np.transpose(self._felupe.drdX[:, :, 0], (2, 0, 1)))

    @property
    def shapes(self) -> Floats:
        """Shape functions (10, q) at the quadrature points."""
        h: Floats = self._felupe.h
        return h[..., 0] if h.ndim == 3 else h

    def at(self, places: Floats) -> tuple[Ints, Floats]:
        """Nodes (k, 10) and shape functions (k, 10) at places (k, 3) [m], or at what is nearest in the body."""
        found = locate(self.mesh.points, self.mesh.tetrahedra, places)
        cells = self.cells[found.element]
        # outside the body the nodes of a face come first
        w = ((found.nodes[:, None, :] == cells[:, :4, None]) * found.weights[:, None, :]).sum(axis=2)
        return cells, np.concatenate([w * (2.0 * w - 1.0), 4.0 * w[:, SIDES[:, 0]] * w[:, SIDES[:, 1]]], axis=1)

    @cached_property
    def pattern(self) -> Pattern:
        """Where the entries of a matrix of the body go."""
        return Pattern.of(self.cells, len(self.points))

    @cached_property
    def outer(self) -> Faces:
        """The whole surface."""
        return self._faces(boundary_faces(self.mesh.tetrahedra).astype(np.int64))

    def faces(self, members: Bools) -> Faces:
        """Faces of the surface of which all corners are members (c,)."""
        triangles = self.outer.nodes[:, :3]
        return self._faces(triangles[members[triangles].all(axis=1)])

    def _faces(self, triangles: Ints) -> Faces:
        sides = triangles[:, [[0, 1], [1, 2], [2, 0]]]
        return Faces(self.points, np.concatenate([triangles, self.middles(sides)], axis=1))

    def nodes(self, name: str) -> Bools:
        """Members (n,) of a set: its corners, and middles on the surface between two of them."""
        corners = self.mesh.node_sets[name]
        members = np.zeros(len(self.points), dtype=bool)
        members[: len(corners)] = corners
        within = self.outer.nodes[:, 3:][corners[self.outer.nodes[:, [[0, 1], [1, 2], [2, 0]]]].all(axis=2)]
        members[within] = True
        return members

    @cached_property
    def centroids(self) -> Floats:
        """Middles of the tetrahedra [m], shape (m, 3)."""
        return self.mesh.points[self.mesh.tetrahedra].mean(axis=1)
