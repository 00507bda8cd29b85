"""Normals of the faces, edges and corners of a surface, by which a point is told to be inside or outside."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Floats
from warpbrain.mesh.surface import face_vectors


def feature_normals(points: Floats, faces: NDArray[np.integer]) -> tuple[Floats, NDArray[np.bool_]]:
    """Angle-weighted normals (Baerentzen and Aanaes 2005) of each triangle's features, and which are on a rim.

    Parameters
    ----------
    points : (n, 3) array
    faces : (k, 3) int array
        Oriented outwards.

    Returns
    -------
    normals : (k, 7, 3) array
        Unit normals of the face, of its edges ab, bc, ca and of its corners. The closest point `p` of a closed surface
        to `x` has `x` outside if `(x - p) . n > 0` with the normal of the feature that `p` is on.
    on_rim : (k, 7) bool array
        True for an edge of one triangle only and its corners, whose normal is that of the face.
    """
    normals = np.empty((len(faces), 7, 3))
    normals[:, 0] = _unit(face_vectors(points, faces))
    on_rim = np.zeros((len(faces), 7), dtype=bool)

    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    _, edge, count = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    edge = edge.reshape(-1, 3)
    sums = np.zeros((len(count), 3))
    np.add.at(sums, edge.ravel(), np.repeat(normals[:, 0], 3, axis=0))
    normals[:, 1:4] = _unit(sums)[edge]
    on_rim[:, 1:4] = (count == 1)[edge]

    sums = np.zeros_like(points)
    for i in range(3):
        here, ahead, behind = (points[faces[:, (i + k) % 3]] for k in range(3))
        cosine = np.einsum("kj,kj->k", _unit(ahead - here), _unit(behind - here))
        np.add.at(sums, faces[:, i], np.arccos(np.clip(cosine, -1.0, 1.0))[:, None] * normals[:, 0])
    normals[:, 4:] = _unit(sums)[faces]
    rim = np.zeros(len(points), dtype=bool)
    rim[edges[(count == 1)[edge.ravel()]].ravel()] = True
    on_rim[:, 4:] = rim[faces]

    return np.where(on_rim[:, :, None], normals[:, :1], normals), on_rim


def _unit(vectors: Floats) -> Floats:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(lengths > 0.0, lengths, 1.0)
