"""Plane cuts through a body of tetrahedra, as polygons that carry what their elements and nodes carry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Floats, Ints

_EDGES = np.array([(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)])


@dataclass(frozen=True)
class Cut:
    """A plane cut.

    Attributes
    ----------
    polygons : list of (3 or 4, 2) arrays
        Corners in the plane, in the two axes that are not cut.
    elements : (k,) int array
        Element of each polygon.
    values : (k,) array
        Mean of the nodal values over the corners of each polygon.
    corners : list of (3 or 4,) arrays
        Values at the corners of each polygon.
    """

    polygons: list[Floats]
    elements: Ints
    values: Floats
    corners: list[Floats]


def cut(points: Floats, tetrahedra: NDArray[np.integer], values: Floats, axis: int, position: float) -> Cut:
    """Cut tetrahedra by the plane ``x[axis] = position``.

    Parameters
    ----------
    points : (n, 3) array
    tetrahedra : (m, 4) int array
    values : (n,) array
        Interpolated along the cut edges.
    axis : int
    position : float
    """
    # a node exactly in the plane counts as above it
    above = points[:, axis] >= position
    crossing = above[tetrahedra].any(axis=1) & ~above[tetrahedra].all(axis=1)
    elements = np.flatnonzero(crossing)
    plane_axes = [k for k in range(3) if k != axis]
    polygons, found = [], []
    for tetrahedron in tetrahedra[elements]:
        ends = tetrahedron[_EDGES]
        ends = ends[above[ends[:, 0]] != above[ends[:, 1]]]
        p, q = points[ends[:, 0]], points[ends[:, 1]]
        t = (position - p[:, axis]) / (q[:, axis] - p[:, axis])
        corners = (p + t[:, None] * (q - p))[:, plane_axes]
        centre = corners.mean(axis=0)
        around = np.argsort(np.arctan2(corners[:, 1] - centre[1], corners[:, 0] - centre[0]))
        polygons.append(corners[around])
        found.append((values[ends[:, 0]] + t * (values[ends[:, 1]] - values[ends[:, 0]]))[around])
    return Cut(polygons, elements, np.array([corners.mean() for corners in found]), found)


def level_line(section: Cut, level: float) -> Floats:
    """Segments in the plane of a cut along which the values are at a level, shape (k, 2, 2)."""
    segments = []
    for polygon, values in zip(section.polygons, section.corners, strict=True):
        nearby, beyond = np.roll(polygon, -1, axis=0), np.roll(values, -1)
        crossed = (values > level) != (beyond > level)
        if crossed.sum() < 2:
            continue
        t = (level - values[crossed]) / (beyond[crossed] - values[crossed])
        ends = polygon[crossed] + t[:, None] * (nearby[crossed] - polygon[crossed])
        segments.append(ends[:2])
    return np.array(segments).reshape(-1, 2, 2)


def outline(points: Floats, faces: NDArray[np.integer], axis: int, position: float) -> Floats:
    """Segments in which triangles cross the plane ``x[axis] = position``, shape (k, 2, 2)."""
    above = points[:, axis] >= position
    crossed = faces[above[faces].any(axis=1) & ~above[faces].all(axis=1)]
    plane_axes = [k for k in range(3) if k != axis]
    segments = []
    for face in crossed:
        ends = face[[(0, 1), (1, 2), (2, 0)]]
        ends = ends[above[ends[:, 0]] != above[ends[:, 1]]]
        p, q = points[ends[:, 0]], points[ends[:, 1]]
        t = (position - p[:, axis]) / (q[:, axis] - p[:, axis])
        segments.append((p + t[:, None] * (q - p))[:, plane_axes])
    return np.array(segments).reshape(-1, 2, 2)
