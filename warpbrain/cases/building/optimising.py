"""Open the sharpest dihedral angles by moving single nodes, worst tetrahedron first."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.building.remeshing import Cells
from warpbrain.mesh.quality import dihedral_angles
from warpbrain.mesh.surface import boundary_faces, face_vectors, interface_faces

Floats = NDArray[np.float64]

SWEEPS = 12
# steps tried, as shares of the mean length of the edges at the node
STEPS = (0.3, 0.15, 0.07, 0.03)
# how far from its surface [share of that length] a boundary or interface node may end, so that surfaces stay smooth
LIFT = 0.1


def open_angles(cells: Cells, wanted: float) -> Cells:
    """Improve every tetrahedron whose smallest dihedral angle is below a bar, as far as its nodes allow.

    Parameters
    ----------
    cells : Cells
        Positively oriented.
    wanted : float
        The bar [degrees].

    Returns
    -------
    Cells
        Same tetrahedra, some nodes moved. A move is made only if the smallest angle of all tetrahedra
        around the node grows, so no tetrahedron can turn over. Nodes on surfaces move along them.
    """
    points = cells.points.copy()
    tets = cells.tetrahedra
    owners = _stars(tets, len(points))
    normals = _normals(cells)
    lifted = np.zeros(len(points))
    for _ in range(SWEEPS):
        worst = dihedral_angles(points, tets).min(axis=1)
        bad = np.flatnonzero(worst < wanted)
        nodes = dict.fromkeys(tets[bad[np.argsort(worst[bad], kind="stable")]].ravel().tolist())
        moved = sum(_improve(int(node), points, tets[owners[node]], normals[node], lifted) for node in nodes)
        if not moved:
            break
    return Cells(points, tets, cells.labels)


def _stars(tets: NDArray[np.int64], count: int) -> list[NDArray[np.int64]]:
    order = np.argsort(tets.ravel(), kind="stable")
    ends = np.cumsum(np.bincount(tets.ravel(), minlength=count))
    return np.split(order // 4, ends[:-1])


def _normals(cells: Cells) -> list[Floats]:
    """Directions each node must not move in: none inside, the normal of its surface, two where surfaces meet."""
    rows: list[list[Floats]] = [[] for _ in cells.points]
    for faces in (
        boundary_faces(cells.tetrahedra),
        interface_faces(cells.tetrahedra, cells.labels % 10),
        interface_faces(cells.tetrahedra, cells.labels // 10),
    ):
        total = np.zeros_like(cells.points)
        np.add.at(total, faces.ravel(), np.repeat(face_vectors(cells.points, faces), 3, axis=0))
        for node in np.unique(faces):
            length = np.linalg.norm(total[node])
            if length > 0:
                rows[node].append(total[node] / length)
    return [np.array(normal).reshape(-1, 3) for normal in rows]


def _directions() -> Floats:
    grid = np.array([[i, j, k] for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1) if i or j or k], dtype=float)
    return np.asarray(grid / np.linalg.norm(grid, axis=1, keepdims=True))


_DIRECTIONS = _directions()


def _improve(node: int, points: Floats, star: NDArray[np.int64], normals: Floats, lifted: Floats) -> bool:
    """Move one node to the best of the positions tried; true if it moved."""
    start = points[node].copy()
    around = points[np.unique(star[star != node])]
    length = float(np.linalg.norm(around - start, axis=1).mean())
    free = _DIRECTIONS
    if len(normals):
        basis = np.linalg.svd(normals, full_matrices=True)[2]
        tangent = basis[np.linalg.matrix_rank(normals, tol=0.2) :]
        free = _DIRECTIONS @ (tangent.T @ tangent)
    candidates = start + length * np.concatenate([step * free for step in STEPS])
    if len(normals):
        # off the surface by no more than the lift, over all sweeps together
        room = max(LIFT * length - lifted[node], 0.0)
        candidates = np.concatenate([candidates, start + room * np.concatenate([_DIRECTIONS, 0.4 * _DIRECTIONS])])
    corners = np.repeat(points[star][None], len(candidates) + 1, axis=0)
    corners[1:][:, star == node] = candidates[:, None]
    flat = corners.reshape(-1, 4, 3)
    cell = np.arange(len(flat) * 4).reshape(-1, 4)
    angles = dihedral_angles(flat.reshape(-1, 3), cell).min(axis=1)
    a, b, c = (flat[:, i] - flat[:, 0] for i in (1, 2, 3))
    angles[np.einsum("ij,ij->i", np.cross(a, b), c) <= 0] = -1
    score = angles.reshape(len(candidates) + 1, -1).min(axis=1)
    best = int(score.argmax())
    if score[best] <= score[0] + 1e-3:
        return False
    points[node] = candidates[best - 1]
    if len(normals):
        lifted[node] += float(np.abs(normals @ (points[node] - start)).max())
    return True
