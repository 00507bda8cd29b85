"""Normals of the faces, edges and corners of a surface, by which a point is told to be inside or outside."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.mesh.surface import face_vectors

Floats = NDArray[np.float64]


#: What a feature can be, as bits: it sticks out, it is hollow (a corner can be both), it is on a rim.
SHARP, HOLLOW, RIM = 1, 2, 4
#: Sine of the angle below which an edge is flat.
_FLAT = 1e-6


def feature_normals(points: Floats, faces: NDArray[np.integer]) -> tuple[Floats, NDArray[np.int32]]:
    """Angle-weighted normals (Baerentzen and Aanaes 2005) of each triangle's features, and what these are.

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
    features : (k, 7) int array
        `SHARP`, `HOLLOW`, both or neither, or `RIM`: an edge of one triangle only, or its corner, whose normal is that
        of the face. A region outside has what is sharp as its closest point, a region inside what is hollow.
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

    # an edge sticks out if the next triangle's far corner lies below the plane of this one
    depth = np.zeros(len(count))
    far = np.stack([points[faces[:, 2]], points[faces[:, 0]], points[faces[:, 1]]], axis=1)
    owners = np.repeat(np.arange(len(faces)), 3)
    order = np.argsort(edge.ravel(), kind="stable")
    firsts = np.searchsorted(edge.ravel()[order], np.arange(len(count)))
    paired = count == 2
    one, other = order[firsts[paired]], order[firsts[paired] + 1]
    reach = far.reshape(-1, 3)[other] - points[faces[owners[one], one % 3]]
    depth[paired] = np.einsum("kj,kj->k", reach, normals[owners[one], 0]) / np.linalg.norm(reach, axis=1)
    kinds = np.zeros(len(count), dtype=np.int32)
    kinds[paired & (depth < -_FLAT)] = SHARP
    kinds[paired & (depth > _FLAT)] = HOLLOW
    of_corners = np.zeros(len(points), dtype=np.int32)
    np.bitwise_or.at(of_corners, edges.ravel(), np.repeat(kinds[edge.ravel()], 2))
    features = np.zeros((len(faces), 7), dtype=np.int32)
    features[:, 1:4] = kinds[edge]
    features[:, 4:] = of_corners[faces]
    features[on_rim] = RIM
    return np.where(on_rim[:, :, None], normals[:, :1], normals), features


def _unit(vectors: Floats) -> Floats:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(lengths > 0.0, lengths, 1.0)
