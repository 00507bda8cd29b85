"""Where points are in a tetrahedral mesh: what makes the displacement of a point that is no node."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from warpbrain.arrays import Floats, Int32s, Ints
from warpbrain.mesh.surface import EDGES, FACES, paired_faces
from warpbrain.recordings.closest import Spheres, closest_points

# how far outside a tetrahedron a point is still inside: as a weight, and as a length in parts of the longest edge.
# Rounding alone puts a point on a common face outside both of its tetrahedra
_WEIGHT, _LENGTH = 1e-9, 1e-10


@dataclass(frozen=True, eq=False)
class Location:
    """Points as weighted nodes."""

    nodes: Int32s  # (n, 4), of the tetrahedron that each point is in, or that has the nearest face of the boundary
    #: (n, 4), values of the shape functions, their sum is 1. Outside the mesh they are those of the closest point of
    #: its boundary.
    weights: Floats
    distance: Floats  # (n,), distance to the mesh [m], zero inside
    edge: Floats  # (n,), mean length of the edges of the tetrahedron [m]
    #: (n,), number of the tetrahedron; inside the mesh `nodes` are in the order of its corners.
    element: Ints

    def __len__(self) -> int:
        return len(self.nodes)

    def interpolate(self, values: ArrayLike) -> Floats:
        """Values (N, k) at the nodes of the mesh, at the points: (n, k)."""
        return np.asarray(np.einsum("ni,nik->nk", self.weights, np.asarray(values, dtype=np.float64)[self.nodes]))

    def matrix(self, count: int) -> Any:
        """The matrix (n, count), SciPy CSR, that takes values at the `count` nodes of the mesh to the points."""
        from scipy.sparse import csr_matrix

        rows = np.repeat(np.arange(len(self)), 4)
        return csr_matrix((self.weights.ravel(), (rows, self.nodes.ravel())), shape=(len(self), count))


def locate(mesh_points: ArrayLike, tetrahedra: ArrayLike, points: ArrayLike) -> Location:
    """Find points in a mesh, or the closest points of its boundary.

    `mesh_points` (N, 3): nodes [m].
    `tetrahedra` (m, 4): node ids.
    `points` (n, 3): what to find [m].
    """
    nodes = np.asarray(mesh_points, dtype=np.float64)
    tets = np.asarray(tetrahedra)
    xyz = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    corners = nodes[tets]
    owner = _containing(corners, xyz)
    inside = np.flatnonzero(owner >= 0)
    outside = np.flatnonzero(owner < 0)
    members = np.zeros((len(xyz), 4), dtype=np.int32)
    weights = np.zeros((len(xyz), 4))
    distance = np.zeros(len(xyz))
    if len(inside):
        members[inside] = tets[owner[inside]]
        # elimination with pivots leaves a small residual however flat the tetrahedron is, where the inverse would not
        sides = corners[owner[inside], 1:] - corners[owner[inside], :1]
        away = (xyz[inside] - corners[owner[inside], 0])[..., None]
        weights[inside, 1:] = np.linalg.solve(sides.transpose(0, 2, 1), away)[..., 0]
        weights[inside, 0] = 1.0 - weights[inside, 1:].sum(axis=1)
    if len(outside):
        single = paired_faces(tets)[1]
        tetrahedron, local = single // 4, single % 4
        faces = tets[tetrahedron[:, None], FACES[local]]
        closest = closest_points(xyz[outside], nodes, faces)
        members[outside, :3] = faces[closest.face]
        members[outside, 3] = tets[tetrahedron, local][closest.face]
        weights[outside, :3] = closest.weights
        distance[outside] = closest.distance
        owner[outside] = tetrahedron[closest.face]
    ends = corners[owner][:, EDGES]
    edge = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2).mean(axis=1)
    return Location(members, weights, distance, edge, owner)


def _containing(corners: Floats, points: Floats) -> Ints:
    """Number of a tetrahedron (m, 4, 3) that each point is in, -1 if it is in none."""
    spheres = Spheres(corners)
    element = np.full(len(points), -1, dtype=np.int64)

    def depth(which: Ints, candidates: Ints) -> Floats:
        """The least weight, -inf if the point is not inside."""
        # of most meshes few tetrahedra are near any point
        near, of = np.unique(candidates, return_inverse=True)
        sides = corners[near, 1:] - corners[near, :1]
        longest = np.linalg.norm(sides, axis=2).max(axis=1)
        flat = np.abs(np.linalg.det(sides)) <= 1e-14 * longest**3
        # rows: gradients of the weights 1, 2 and 3
        gradients = np.linalg.inv(np.where(flat[:, None, None], np.eye(3), sides)).transpose(0, 2, 1)
        gradients = np.concatenate([-gradients.sum(axis=1, keepdims=True), gradients], axis=1)
        allowed = np.maximum(_WEIGHT, _LENGTH * longest[:, None] * np.linalg.norm(gradients, axis=2))
        w = np.einsum("nij,nj->ni", gradients[of], points[which] - corners[candidates, 0])
        w[:, 0] += 1.0
        within = (w >= -allowed[of]).all(axis=1) & ~flat[of]
        return np.where(within, w.min(axis=1), -np.inf)

    # nearly every point is in one of the tetrahedra whose centres are nearest
    open_ = np.arange(len(points))
    for column in spheres.nearest(points, 6).T:
        hit = depth(open_, column[open_]) >= 0.0
        element[open_[hit]] = column[open_[hit]]
        open_ = open_[~hit]
    best = np.full(len(points), -np.inf)
    for which, candidates in spheres.touching(points[open_], np.zeros(len(open_))):
        which = open_[which]
        d = depth(which, candidates)
        order = np.lexsort((candidates, -d, which))
        first = order[np.append(True, which[order][1:] != which[order][:-1])] if len(order) else order
        first = first[d[first] > best[which[first]]]
        element[which[first]], best[which[first]] = candidates[first], d[first]
    return element
