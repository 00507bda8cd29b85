"""How good a mesh is: dihedral angles, and the pieces that faces hold together."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpbrain.arrays import Floats, Int32s, Ints
from warpbrain.mesh.surface import EDGES, FACES, connected, edges_of, paired_faces
from warpbrain.mesh.tet_mesh import TetMesh, signed_volumes

# the two faces that meet at each of `EDGES`, by the corner each face is opposite to
_OPPOSITE = np.array([[2, 3], [1, 3], [1, 2], [0, 3], [0, 2], [0, 1]])


def dihedral_angles(points: ArrayLike, tetrahedra: ArrayLike) -> Floats:
    """Angles between the faces of tetrahedra.

    `points` (n, 3): node positions, any unit. `tetrahedra` (m, 4): node ids, positively oriented. Returns (m, 6):
    interior dihedral angle [degrees] at edges 01, 02, 03, 12, 13, 23. A regular tetrahedron has arccos(1/3) = 70.53
    degrees at every edge. The angle is made from the sine and the cosine, so that flat tetrahedra are measured as well
    as good ones.
    """
    corner = np.asarray(points, dtype=np.float64)[np.asarray(tetrahedra)]
    start, end = corner[:, EDGES[:, 0]], corner[:, EDGES[:, 1]]
    edge = end - start
    edge /= np.maximum(np.linalg.norm(edge, axis=2, keepdims=True), np.finfo(float).tiny)
    legs = [corner[:, _OPPOSITE[:, k]] - start for k in (0, 1)]
    across = [leg - np.einsum("mei,mei->me", leg, edge)[..., None] * edge for leg in legs]
    sine = np.linalg.norm(np.cross(across[0], across[1]), axis=2)
    cosine = np.einsum("mei,mei->me", across[0], across[1])
    return np.asarray(np.degrees(np.arctan2(sine, cosine)))


def components(tetrahedra: ArrayLike, tissue: ArrayLike | None = None) -> Int32s:
    """Number of the face-connected piece that each tetrahedron belongs to.

    `tetrahedra` (m, 4): node ids. `tissue` (m,): if given, faces between different labels do not connect: pieces are
    then pieces of one tissue. Returns (m,): piece numbers 0, 1, ... in order of each piece's first tetrahedron.
    """
    tets = np.asarray(tetrahedra)
    pair = paired_faces(tets)[0] // len(FACES)
    if tissue is not None:
        labels = np.asarray(tissue)
        pair = pair[labels[pair[:, 0]] == labels[pair[:, 1]]]
    numbers = connected(pair, len(tets))
    first = np.unique(numbers, return_index=True)[1]
    return np.argsort(np.argsort(first)).astype(np.int32)[numbers]


@dataclass(frozen=True)
class Quality:
    """Summary of a mesh; angles in degrees, volumes in m3, lengths in m."""

    nodes: int
    tetrahedra: int
    volume: float
    inverted: int
    min_dihedral: float
    first_percentile_dihedral: float
    max_dihedral: float
    mean_edge: float
    components: int
    tissue_components: dict[int, int]
    smallest_tissue_component_volume: float
    smallest_tissue_component_tetrahedra: int


def measure(mesh: TetMesh) -> Quality:
    """Quality summary of a mesh.

    The first percentile is taken over the smallest dihedral angle of each tetrahedron, which is a harder
    measure than over all six angles.
    """
    return measure_arrays(mesh.points, mesh.tetrahedra, mesh.tissue)


def measure_arrays(points: Floats, tetrahedra: Int32s, tissue: Int32s) -> Quality:
    """As `measure`, of arrays that need not be a valid mesh: points (n, 3) [m], tetrahedra (m, 4), tissue (m,)."""
    angles = dihedral_angles(points, tetrahedra)
    volumes = signed_volumes(points, tetrahedra)
    pieces = components(tetrahedra, tissue)
    return Quality(
        nodes=len(points),
        tetrahedra=len(tetrahedra),
        volume=float(volumes.sum()),
        inverted=int((volumes <= 0).sum()),
        min_dihedral=float(angles.min()),
        first_percentile_dihedral=float(np.percentile(angles.min(axis=1), 1)),
        max_dihedral=float(angles.max()),
        mean_edge=mean_edge(points, tetrahedra),
        components=int(components(tetrahedra).max()) + 1,
        tissue_components={int(t): len(np.unique(pieces[tissue == t])) for t in np.unique(tissue)},
        smallest_tissue_component_volume=float(np.bincount(pieces, weights=volumes).min()),
        smallest_tissue_component_tetrahedra=int(np.bincount(pieces).min()),
    )


def mean_edge(points: Floats, tetrahedra: NDArray[np.integer]) -> float:
    """Mean length of the edges of tetrahedra (m, 4), in the unit of points (n, 3)."""
    edges = np.unique(np.sort(tetrahedra[:, EDGES].reshape(-1, 2), axis=1), axis=0)
    return float(np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1).mean())


def extent(points: NDArray[np.floating[Any]]) -> float:
    """Twice the distance of the farthest of points (n, 3) from their mean, in their unit.

    Of a block it is the diagonal. A bounding box along the axes is up to 1.7 times as large for a body that was turned.
    """
    return 2.0 * float(np.linalg.norm(points - points.mean(axis=0), axis=1).max())


def principal_axes(points: NDArray[np.floating[Any]]) -> Floats:
    """Unit vectors, rows of (3, 3), along which points (n, 3) spread the least, more and the most.

    They turn with a body; of one that spreads alike along several axes these are any.
    """
    apart = points - points.mean(axis=0)
    return np.asarray(np.linalg.eigh(apart.T @ apart)[1].T, dtype=np.float64)


#: Nodes nearer to each other than this share of the body's size are at the same place.
SAME_PLACE = 1e-9


def coincident_nodes(points: ArrayLike) -> Ints:
    """Pairs (k, 2) of nodes of points (n, 3) at the same place: there the body is torn, though it looks whole."""
    from scipy.spatial import cKDTree

    xyz: Floats = np.asarray(points, dtype=np.float64)
    pairs = cKDTree(xyz).query_pairs(SAME_PLACE * extent(xyz), output_type="ndarray")
    return np.asarray(pairs[np.lexsort(pairs.T[::-1])], dtype=np.int64)


def open_edges(faces: ArrayLike) -> Ints:
    """Edges (k, 2) that do not belong to exactly two of the triangles (b, 3): none on a closed surface."""
    unique, count = np.unique(edges_of(faces), axis=0, return_counts=True)
    return np.asarray(unique[count != 2], dtype=np.int64)
