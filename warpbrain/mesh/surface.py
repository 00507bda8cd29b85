"""Surfaces of tetrahedra, as arrays of node ids: boundary, closed surfaces that make it up, interfaces of tissues."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpbrain.arrays import Bools, Floats, Int32s, Ints

# corners of the four faces of a positive tetrahedron, each seen counter-clockwise from outside; face i is opposite i
FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
#: Corners of the edges of a tetrahedron.
EDGES = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])
#: Corners of the sides of a triangle, one way around.
SIDES = np.array([[0, 1], [1, 2], [2, 0]])


def connected(links: NDArray[np.integer], count: int) -> Int32s:
    """Number (count,) of the connected part that each of some things is in, by pairs (k, 2) of things that touch."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(links), dtype=bool), (links[:, 0], links[:, 1])), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1])


def edges_of(faces: ArrayLike) -> Ints:
    """Sides (3 b, 2) of triangles (b, 3), one triangle after the other, ends ascending."""
    return np.sort(np.asarray(faces, dtype=np.int64)[:, SIDES].reshape(-1, 2), axis=1)


def paired_faces(tetrahedra: ArrayLike) -> tuple[Ints, Ints]:
    """Which faces of which tetrahedra coincide.

    `tetrahedra` (m, 4): node ids. Returns `pairs` (k, 2): faces shared by two tetrahedra; face number = 4 * tetrahedron
    + local face; `single` (b,): faces that only one tetrahedron has. `ValueError` if a face belongs to three or more
    tetrahedra.
    """
    tets = np.asarray(tetrahedra)
    faces = np.sort(tets[:, FACES].reshape(-1, 3), axis=1)
    count = int(tets.max(initial=0)) + 1
    # three nodes as one number, where that fits, are sorted in a third of the time
    order = np.argsort(faces @ [count**2, count, 1]) if count**3 < 2**63 else np.lexsort(faces.T[::-1])
    ordered = faces[order]
    same = np.append((ordered[1:] == ordered[:-1]).all(axis=1), False)
    if (same[1:] & same[:-1]).any():
        at = int(np.flatnonzero(same[1:] & same[:-1])[0])
        raise ValueError(f"face {ordered[at].tolist()} belongs to three or more tetrahedra")
    follows = np.append(False, same[:-1])
    first = np.flatnonzero(same)
    pairs = np.sort(np.stack([order[first], order[first + 1]], axis=1), axis=1)
    return pairs[np.argsort(pairs[:, 0])], np.sort(order[~same & ~follows])


def _corners(tetrahedra: ArrayLike, faces: Ints) -> Int32s:
    tets = np.asarray(tetrahedra)
    return np.asarray(tets[faces[:, None] // 4, FACES[faces % 4]], dtype=np.int32)


def all_faces(tetrahedra: ArrayLike) -> Int32s:
    """Every triangle of a mesh once, inside and on the boundary.

    `tetrahedra` (m, 4): node ids. Returns (k, 3): node ids.
    """
    pairs, single = paired_faces(tetrahedra)
    return _corners(tetrahedra, np.concatenate([pairs[:, 0], single]))


def boundary_faces(tetrahedra: ArrayLike) -> Int32s:
    """Triangles of the boundary, oriented outwards.

    `tetrahedra` (m, 4): node ids, positively oriented. Returns (b, 3): node ids; ``(p1 - p0) x (p2 - p0)`` points out
    of the body, into a cavity where there is one.
    """
    return _corners(tetrahedra, paired_faces(tetrahedra)[1])


def interface_faces(tetrahedra: ArrayLike, tissue: ArrayLike) -> Int32s:
    """Triangles between tetrahedra of different labels.

    `tetrahedra` (m, 4): node ids, positively oriented. `tissue` (m,): labels; a boolean element set works as well.
    Returns (k, 3): node ids; the normal points away from the smaller label.
    """
    pairs = paired_faces(tetrahedra)[0]
    labels = np.asarray(tissue)[pairs // 4]
    between = labels[:, 0] != labels[:, 1]
    owner = np.where(labels[between, 0] < labels[between, 1], pairs[between, 0], pairs[between, 1])
    return _corners(tetrahedra, owner)


def in_rows(faces: ArrayLike, others: ArrayLike) -> Bools:
    """Which of some triangles (b, 3) are among others (k, 3), whatever the order of their nodes: (b,) bool."""
    rows = [np.sort(np.asarray(triangles, dtype=np.int64).reshape(-1, 3), axis=1) for triangles in (faces, others)]
    number = np.unique(np.concatenate(rows), axis=0, return_inverse=True)[1].ravel()
    return np.asarray(np.isin(number[: len(rows[0])], number[len(rows[0]) :]))


def rim_edges(faces: ArrayLike) -> Ints:
    """Edges at which an oriented surface ends.

    `faces` (b, 3): triangles, all oriented to one side. Returns (k, 2): edges that triangles do not run along as often
    one way as the other: none on a closed surface, even one that touches itself.
    """
    triangles = np.asarray(faces, dtype=np.int64)
    sides = triangles[:, SIDES].reshape(-1, 2)
    edges, number = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True)
    along = np.bincount(number.ravel(), weights=np.where(sides[:, 0] < sides[:, 1], 1.0, -1.0), minlength=len(edges))
    return np.asarray(edges[along != 0.0])


def closed_surfaces(faces: ArrayLike, joins: Bools | None = None) -> Int32s:
    """Number of the edge-connected surface each triangle belongs to.

    `faces` (b, 3): node ids. `joins` (3 b,): which of their sides, see `edges_of`, connect; all by default. Returns
    (b,): surface numbers 0, 1, ...
    """
    count = len(np.asarray(faces))
    number = np.unique(edges_of(faces), axis=0, return_inverse=True)[1].ravel()
    # triangles and edges are the two sides of one graph, so an edge of any number of triangles is no special case
    links = np.column_stack([np.repeat(np.arange(count), 3), count + number])
    labels = connected(links if joins is None else links[joins], count + int(number.max()) + 1)[:count]
    return np.asarray(np.unique(labels, return_inverse=True)[1].ravel(), dtype=np.int32)


def pinched_nodes(faces: ArrayLike) -> Int32s:
    """Nodes where closed surfaces touch themselves or each other.

    `faces` (b, 3): node ids; every edge belongs to an even number of triangles. Returns (k,): ids of nodes on an edge
    of more than two triangles, and of nodes whose triangles form more than one fan. Empty for smooth closed surfaces.
    """
    triangles = np.asarray(faces)
    sides = triangles[:, SIDES].reshape(-1, 2)
    # number of the triangle's own corner at either end of each side, sides turned so that equal ones look equal
    corners = (3 * np.arange(len(triangles))[:, None, None] + SIDES).reshape(-1, 2)
    turned = sides[:, 0] > sides[:, 1]
    sides[turned], corners[turned] = sides[turned, ::-1], corners[turned, ::-1]
    order = np.lexsort(sides.T)
    same = (sides[order][1:] == sides[order][:-1]).all(axis=1)
    first, second = corners[order][:-1][same], corners[order][1:][same]
    links = np.concatenate([np.stack([first[:, k], second[:, k]], axis=1) for k in (0, 1)])
    fan = connected(links, triangles.size)
    node_of_fan = np.unique(np.stack([triangles.ravel(), fan], axis=1), axis=0)[:, 0]
    nodes, fans = np.unique(node_of_fan, return_counts=True)
    edges, owners = np.unique(sides, axis=0, return_counts=True)
    return np.asarray(np.union1d(nodes[fans > 1], edges[owners > 2].ravel()), dtype=np.int32)


def split_boundary(points: ArrayLike, tetrahedra: ArrayLike) -> tuple[Int32s, list[Int32s]]:
    """Outer surface and cavity walls.

    `points` (n, 3): node positions. `tetrahedra` (m, 4): node ids, positively oriented. Returns `outer` (b, 3):
    triangles of the surfaces that enclose volume: one surface for a body in one piece; `cavities` (c, 3): triangles of
    each closed surface that excludes volume, largest volume first; normals point into the cavity.
    """
    faces = boundary_faces(tetrahedra)
    surface = closed_surfaces(faces)
    xyz = np.asarray(points, dtype=np.float64)
    xyz = xyz - xyz.mean(axis=0)
    corner = xyz[faces]
    enclosed = np.einsum("ij,ij->i", np.cross(corner[:, 0], corner[:, 1]), corner[:, 2]) / 6.0
    volume = np.bincount(surface, weights=enclosed)
    holes = np.flatnonzero(volume < 0)
    cavities = [faces[surface == k] for k in holes[np.argsort(volume[holes])]]
    return faces[volume[surface] > 0], cavities


def nodes_of(faces: ArrayLike, count: int) -> Bools:
    """Node set of some triangles: (count,) bool array, true for every node that `faces` (b, 3) names."""
    members = np.zeros(count, dtype=bool)
    members[np.asarray(faces).ravel()] = True
    return members


def face_vectors(points: ArrayLike, faces: ArrayLike) -> Floats:
    """Area vectors (b, 3) of triangles (b, 3): along the normal, as long as the area is large."""
    corner = np.asarray(points, dtype=np.float64)[np.asarray(faces)]
    return np.asarray(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]) / 2.0)


def node_vectors(points: ArrayLike, faces: ArrayLike) -> Floats:
    """Sum (n, 3) of the area vectors of all triangles (b, 3) at each node (n, 3); zero where there is no triangle."""
    total = np.zeros(np.shape(points))
    np.add.at(total, np.asarray(faces).ravel(), np.repeat(face_vectors(points, faces), 3, axis=0))
    return total


def tangents(normals: ArrayLike) -> Floats:
    """Two unit vectors (..., 2, 3) at right angles to directions (..., 3), and to each other."""
    return np.asarray(np.linalg.svd(np.asarray(normals, dtype=np.float64)[..., None, :])[2][..., 1:, :])


def node_areas(points: ArrayLike, faces: ArrayLike) -> Floats:
    """Surface area lumped to nodes: a third of every triangle's area goes to each of its corners.

    `points` (n, 3): node positions [m]. `faces` (b, 3): triangles. Returns (n,): area [m2]; zero for nodes that `faces`
    does not name.
    """
    share = np.linalg.norm(face_vectors(points, faces), axis=1) / 3.0
    triangles = np.asarray(faces)
    lumped = np.bincount(triangles.ravel(), weights=np.repeat(share, 3), minlength=len(np.asarray(points)))
    return np.asarray(lumped, dtype=np.float64)


def feature_normals(points: Floats, faces: NDArray[np.integer]) -> tuple[Floats, Bools]:
    """Angle-weighted normals (Baerentzen and Aanaes 2005) of each triangle's features, and which are on a rim.

    `points` (n, 3). `faces` (k, 3): oriented outwards. Returns `normals` (k, 7, 3): unit normals of the face, of its
    edges ab, bc, ca and of its corners, and `on_rim` (k, 7): True for an edge of one triangle only and its corners,
    whose normal is that of the face. The closest point `p` of a closed surface to `x` has `x` outside if
    `(x - p) . n > 0` with the normal of the feature that `p` is on.
    """
    normals = np.empty((len(faces), 7, 3))
    normals[:, 0] = unit(face_vectors(points, faces))
    on_rim = np.zeros((len(faces), 7), dtype=bool)

    edges = edges_of(faces)
    _, edge, count = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    edge = edge.reshape(-1, 3)
    sums = np.zeros((len(count), 3))
    np.add.at(sums, edge.ravel(), np.repeat(normals[:, 0], 3, axis=0))
    normals[:, 1:4] = unit(sums)[edge]
    on_rim[:, 1:4] = (count == 1)[edge]

    sums = np.zeros_like(points)
    for i in range(3):
        here, ahead, behind = (points[faces[:, (i + k) % 3]] for k in range(3))
        cosine = np.einsum("kj,kj->k", unit(ahead - here), unit(behind - here))
        np.add.at(sums, faces[:, i], np.arccos(np.clip(cosine, -1.0, 1.0))[:, None] * normals[:, 0])
    normals[:, 4:] = unit(sums)[faces]
    on_rim[:, 4:] = nodes_of(edges[(count == 1)[edge.ravel()]], len(points))[faces]

    return np.where(on_rim[:, :, None], normals[:, :1], normals), on_rim


def unit(vectors: Floats) -> Floats:
    """Vectors (..., 3) of length 1 along others; zero where these are."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(lengths > 0.0, lengths, 1.0)
