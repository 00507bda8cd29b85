"""Pieces of a tissue too small for a mesh go to the neighbour that they touch most."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.mesh.quality import components
from warpbrain.mesh.surface import FACES, face_vectors, paired_faces
from warpbrain.mesh.tet_mesh import signed_volumes

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


def crumbs_given_away(points: Floats, tetrahedra: Integers, labels: Integers, smallest: float) -> Integers:
    """Labels without small pieces.

    Parameters
    ----------
    points : (n, 3) array
        [mm]
    tetrahedra : (m, 4) array
        In one piece.
    labels : (m,) array
    smallest : float
        Volume [mm3] that a face-connected piece of one label must have to stay.

    Returns
    -------
    (m,) array
        Small pieces have the label of the larger piece with which they share the most area, starting with those that
        touch one.
    """
    labels = labels.copy()
    volumes = signed_volumes(points, tetrahedra)
    pairs, _ = paired_faces(tetrahedra)
    owner = pairs // 4
    area = _areas(points, tetrahedra, pairs[:, 0])
    while True:
        piece = components(tetrahedra, labels)
        volume = np.bincount(piece, weights=volumes)
        small = volume < smallest
        side = piece[owner]
        # faces between a small piece and one that stays, the small one first
        side, weight = np.concatenate([side, side[:, ::-1]]), np.concatenate([area, area])
        at = small[side[:, 0]] & ~small[side[:, 1]]
        if not at.any():
            return labels
        label_of = np.zeros(len(volume), dtype=np.int64)
        label_of[piece] = labels
        touched, shared = np.unique(np.stack([side[at, 0], label_of[side[at, 1]]], axis=1), axis=0, return_inverse=True)
        total = np.bincount(shared.ravel(), weights=weight[at])
        # the last of each piece in this order has the most area
        for number in np.argsort(total, kind="stable"):
            label_of[touched[number, 0]] = touched[number, 1]
        labels = label_of[piece]


def _areas(points: Floats, tetrahedra: Integers, faces: Integers) -> Floats:
    """Areas of faces given as 4 * tetrahedron + local face."""
    triangles = tetrahedra[faces[:, None] // 4, FACES[faces % 4]]
    return np.asarray(np.linalg.norm(face_vectors(points, triangles), axis=1))
