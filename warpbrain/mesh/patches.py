"""A patch of a surface: the connected piece of it near a point, seen from one side; and points nearest on triangles."""

import numpy as np
from numpy.typing import ArrayLike

from warpbrain.arrays import Floats, Ints
from warpbrain.mesh.surface import SIDES, closed_surfaces, face_vectors

#: Cosine of the angle between two triangles that face different ways: a right angle, but for rounding.
_ASIDE = 1e-6


def patch_around(points: ArrayLike, faces: ArrayLike, centre: ArrayLike, radius: float) -> Ints:
    """Triangles that belong to the patch of a surface around the point of it that is nearest to a centre.

    Those that come within the radius, face the same way as the triangle at that point (less than a right angle from
    it), and hang together with it through edges within the radius of such triangles. A ball alone would hold the far
    side of a thin body, a ventricle's wall under a thin mantle and the other bank of a sulcus. Distances along the
    surface would tell these apart as well where the way around is long, but not at an edge or a crest; paths along the
    edges of triangles are as much too long as the mesh is coarse, and what they select jumps as a centre moves.

    `points` (n, 3): node positions [m]. `faces` (b, 3): triangles of the surface, oriented outwards. `centre` (3,) and
    `radius` [m]. Returns (k,): numbers of triangles, increasing; empty if none comes within the radius.
    """
    triangles = np.asarray(faces)
    corners = np.asarray(points, dtype=np.float64)[triangles] - np.asarray(centre, dtype=np.float64)
    # NumPy's reductions take several times as long along three numbers
    middle = (corners[:, 0] + corners[:, 1] + corners[:, 2]) / 3.0
    squares = [np.einsum("ij,ij->i", away, away) for away in (corners[:, k] - middle for k in range(3))]
    reach = np.sqrt(np.maximum(np.maximum(squares[0], squares[1]), squares[2]))
    near = np.flatnonzero(np.einsum("ij,ij->i", middle, middle) < (radius + reach) ** 2)
    if not len(near):
        return near
    distance = closest_on_triangles(np.zeros(3), corners[near])[1]
    start = int(np.argmin(distance))
    if distance[start] >= radius:
        return np.zeros(0, dtype=np.int64)
    normals = face_vectors(points, triangles[near])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    facing = normals @ normals[start] > _ASIDE
    taken = np.flatnonzero((distance < radius) & facing)
    # how near the sides come to the centre
    start_of, end_of = np.moveaxis(corners[near[taken]][:, SIDES], 2, 0)
    along = end_of - start_of
    part = np.clip(-(start_of * along).sum(axis=-1) / (along**2).sum(axis=-1), 0.0, 1.0)
    within = np.linalg.norm(start_of + part[..., None] * along, axis=-1).ravel() < radius
    together = closed_surfaces(triangles[near[taken]], within)
    return np.asarray(near[taken[together == together[np.searchsorted(taken, start)]]])


def closest_on_triangles(points: Floats, corners: Floats) -> tuple[Floats, Floats]:
    """Barycentric coordinates (n, 3) of the closest point of one triangle (n, 3, 3) a point, and its distance (n,).

    `points` (n, 3), or (3,) if it is one. Triangles without area count as the segments they are.
    """
    a = corners[:, 0]
    ab, ac, ap = corners[:, 1] - a, corners[:, 2] - a, points - a
    normal = np.cross(ab, ac)
    area = np.einsum("ij,ij->i", normal, normal)
    longest = np.maximum(np.einsum("ij,ij->i", ab, ab), np.einsum("ij,ij->i", ac, ac))
    flat = area <= 1e-28 * longest**2
    safe = np.where(flat, 1.0, area)
    v = np.einsum("ij,ij->i", np.cross(ap, ac), normal) / safe
    w = np.einsum("ij,ij->i", np.cross(ab, ap), normal) / safe
    best = np.stack([1.0 - v - w, v, w], axis=1)
    inside = ~flat & (best >= 0.0).all(axis=1)
    distance = np.where(inside, _distance(points, corners, best), np.inf)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        side = corners[:, j] - corners[:, i]
        square = np.einsum("ij,ij->i", side, side)
        along = np.einsum("ij,ij->i", points - corners[:, i], side) / np.where(square > 0.0, square, 1.0)
        along = np.clip(along, 0.0, 1.0)
        candidate = np.zeros_like(best)
        candidate[:, i], candidate[:, j] = 1.0 - along, along
        apart = _distance(points, corners, candidate)
        closer = apart < distance
        best[closer], distance[closer] = candidate[closer], apart[closer]
    return best, distance


def _distance(points: Floats, corners: Floats, weights: Floats) -> Floats:
    return np.linalg.norm(np.einsum("ni,nij->nj", weights, corners - points[..., None, :]), axis=1)
