"""A patch of a surface: the connected piece of it near a point, seen from one side."""

from __future__ import annotations

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
    middle = corners.mean(axis=1)
    reach = np.sqrt(((corners - middle[:, None]) ** 2).sum(axis=2).max(axis=1))
    near = np.flatnonzero(np.linalg.norm(middle, axis=1) < radius + reach)
    if not len(near):
        return near
    weights = nearest_to_origin(corners[near])
    distance = np.linalg.norm(np.einsum("kc,kci->ki", weights, corners[near]), axis=1)
    start = int(np.argmin(distance))
    if distance[start] >= radius:
        return np.zeros(0, dtype=np.int64)
    normals = face_vectors(points, triangles[near])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    facing = normals @ normals[start] > _ASIDE
    taken = np.flatnonzero((distance < radius) & facing)
    within = _nearest_on_sides(corners[near[taken]][:, SIDES])[1].ravel() < radius
    together = closed_surfaces(triangles[near[taken]], within)
    return np.asarray(near[taken[together == together[np.searchsorted(taken, start)]]])


def nearest_to_origin(corners: Floats) -> Floats:
    """Barycentric coordinates (k, 3) of the points nearest to the origin of triangles with corners (k, 3, 3)."""
    a, along = corners[:, 0], corners[:, 1:] - corners[:, :1]
    metric = along @ along.transpose(0, 2, 1)
    inner = np.linalg.solve(metric, -np.einsum("kci,ki->kc", along, a)[..., None])[..., 0]
    barycentric = np.column_stack([1.0 - inner.sum(axis=1), inner])
    outside = np.flatnonzero((barycentric < 0.0).any(axis=1))
    # beyond the triangle the nearest point is on a side
    ends = corners[outside][:, SIDES]
    part, distance = _nearest_on_sides(ends)
    side, every = np.argmin(distance, axis=1), np.arange(len(outside))
    barycentric[outside] = 0.0
    barycentric[outside, SIDES[side, 0]] = 1.0 - part[every, side]
    barycentric[outside, SIDES[side, 1]] = part[every, side]
    return barycentric


def _nearest_on_sides(ends: Floats) -> tuple[Floats, Floats]:
    """Where on segments with ends (..., 2, 3) the point nearest to the origin is, 0 to 1, and how far away."""
    along = ends[..., 1, :] - ends[..., 0, :]
    part = np.clip(-(ends[..., 0, :] * along).sum(axis=-1) / (along**2).sum(axis=-1), 0.0, 1.0)
    return part, np.linalg.norm(ends[..., 0, :] + part[..., None] * along, axis=-1)
