"""Is a mesh of tetrahedra one sound body? What `TetMesh` allows and a body does not."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpbrain.mesh.extent import extent
from warpbrain.mesh.tet_mesh import Floats

#: Nodes nearer to each other than this share of the body's size are at the same place.
SAME_PLACE = 1e-9


def coincident_nodes(points: ArrayLike) -> NDArray[np.int64]:
    """Pairs (k, 2) of nodes of points (n, 3) at the same place: there the body is torn, though it looks whole."""
    from scipy.spatial import cKDTree

    xyz: Floats = np.asarray(points, dtype=np.float64)
    pairs = cKDTree(xyz).query_pairs(SAME_PLACE * extent(xyz), output_type="ndarray")
    return np.asarray(pairs[np.lexsort(pairs.T[::-1])], dtype=np.int64)


def open_edges(faces: ArrayLike) -> NDArray[np.int64]:
    """Edges (k, 2) that do not belong to exactly two of the triangles (b, 3): none on a closed surface."""
    triangles = np.asarray(faces)
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    return np.asarray(unique[count != 2], dtype=np.int64)
