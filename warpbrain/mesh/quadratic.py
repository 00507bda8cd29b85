"""Tetrahedra of second order: ten nodes each, four corners and a node in the middle of every edge.

Sides are straight: a midside node lies halfway between the ends of its edge in the reference shape, and only there.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpbrain.arrays import Bools, Floats, Int32s, Ints
from warpbrain.mesh.refinement import edge_numbers, finer_mesh, inherited
from warpbrain.mesh.surface import EDGES, nodes_of
from warpbrain.mesh.tet_mesh import TetMesh

#: Parts of a tetrahedron's mass for each corner and each midside node: the diagonal of the consistent mass matrix,
#: `V/70` and `8 V/105`, scaled to the mass of the element (Hinton, Rock and Zienkiewicz 1976).
CORNER_MASS, MIDSIDE_MASS = 1.0 / 36.0, 4.0 / 27.0


@dataclass(frozen=True, eq=False)
class QuadraticMesh:
    """A mesh with midside nodes. `corners`: what it is of; its n nodes come first."""

    corners: TetMesh
    #: Linear tetrahedra with a corner at each of the N nodes: every element cut into eight. Sets are those of
    #: `corners`, see `warpbrain.mesh.refinement.refined`; made once for a mesh.
    node_mesh: TetMesh = field(init=False)
    #: (N, 2), corners between which each node lies in the middle; a corner lies between itself and itself.
    ends: Int32s = field(init=False)
    #: (m, 10), nodes of each tetrahedron, ascending: its corners, then its midside nodes in the order of
    #: `warpbrain.mesh.surface.EDGES`.
    elements: Int32s = field(init=False)

    def __post_init__(self) -> None:
        node_mesh, ends = finer_mesh(self.corners)
        object.__setattr__(self, "node_mesh", node_mesh)
        object.__setattr__(self, "ends", ends)
        shared = self.corners.shared
        if "ten nodes" not in shared:
            corners = np.sort(self.corners.tetrahedra, axis=1)
            shared["ten nodes"] = np.concatenate([corners, self.middles(corners[:, EDGES])], axis=1).astype(np.int32)
        object.__setattr__(self, "elements", shared["ten nodes"])

    def middles(self, edges: NDArray[np.integer]) -> Ints:
        """Node in the middle of each edge (..., 2), its ends ascending."""
        count = len(self.corners.points)
        return count + edge_numbers(self.ends[count:], edges, count)

    @property
    def points(self) -> Floats:
        """Node positions (N, 3) [m]."""
        return self.node_mesh.points

    @property
    def node_sets(self) -> Mapping[str, Bools]:
        """Named sets of all nodes, (N,) bool arrays."""
        return self.node_mesh.node_sets

    @property
    def node_volumes(self) -> Floats:
        """Volume lumped to each node [m3], shape (N,), positive everywhere; for masses."""
        return self.lumped(self.corners.volumes)

    def lumped(self, values: Floats) -> Floats:
        """Values of elements (m,) shared among their nodes, shape (N,)."""
        shares = values[:, None] * np.repeat([CORNER_MASS, MIDSIDE_MASS], [4, 6])
        return np.bincount(self.elements.ravel(), shares.ravel(), minlength=len(self.ends)).astype(np.float64)

    @cached_property
    def on_surface(self) -> Bools:
        """Nodes of the boundary, (N,) bool."""
        return nodes_of(self.node_mesh.boundary, len(self.ends))

    @cached_property
    def faces(self) -> Int32s:
        """Triangles of the boundary (b, 6), oriented outwards: corners 0, 1, 2, then the middles of 01, 02 and 12."""
        return self.six_nodes(self.corners.boundary)

    def six_nodes(self, triangles: ArrayLike) -> Int32s:
        """Triangles (k, 3) of corners with their midside nodes, (k, 6)."""
        corners = np.asarray(triangles)
        sides = np.sort(corners[:, [[0, 1], [0, 2], [1, 2]]], axis=2)
        return np.concatenate([corners, self.middles(sides)], axis=1).astype(np.int32)

    def inherited(self, members: Bools) -> Bools:
        """A set of corners (n,) as a set of all nodes (N,), by the rule of `warpbrain.mesh.refinement.inherited`."""
        return inherited(members, self.ends, self.on_surface)

    def between(self, values: Floats) -> Floats:
        """Values at corners (n, ...) at all nodes (N, ...): those of midside nodes are the means of their ends."""
        return np.asarray(values[self.ends].mean(axis=1))

    def at_middles(self, values: Floats) -> Floats:
        """Values at all nodes (N, c) in the middle of the `EDGES` of each of `corners.tetrahedra`: (m, 6, c)."""
        return np.asarray(values[self.middles(np.sort(self.corners.tetrahedra[:, EDGES], axis=2))])

    def at_corners(self, forces: Floats) -> Floats:
        """Forces (N, 3) as forces on corners (n, 3), half of a midside node's at each end: the same sum and moments."""
        at_ends = np.zeros((len(self.corners.points), forces.shape[1]))
        np.add.at(at_ends, self.ends, 0.5 * forces[:, None, :])
        return at_ends


def quadratic_interpolant(weights: Floats, corners: Floats, middles: Floats) -> Floats:
    """A field of quadratic tetrahedra with straight sides at points in them.

    `weights` (n, 4): barycentric coordinates of each point. `corners` (n, 4, c): values at the corners of its
    tetrahedron. `middles` (n, 6, c): values in the middle of the edges, in the order of `warpbrain.mesh.surface.EDGES`.
    Returns (n, c).
    """
    of_corners = np.einsum("na,nac->nc", weights * (2.0 * weights - 1.0), corners)
    return np.asarray(of_corners + np.einsum("na,nac->nc", 4.0 * weights[:, EDGES].prod(axis=2), middles))
