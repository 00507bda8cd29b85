"""Plane cuts through a body of tetrahedra, as polygons that carry what their elements and nodes carry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Floats, Ints

_EDGES = np.array([(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)])
_SIDES = np.array([(0, 1), (1, 2), (2, 0)])


@dataclass(frozen=True)
class Cut:
    """A plane cut."""

    #: Corners (3 or 4, 2) in the plane, in the two axes that are not cut; and the element (k,) of each polygon.
    polygons: list[Floats]
    elements: Ints
    #: Mean (k,) of the nodal values over the corners of each polygon, and values (3 or 4,) at these.
    values: Floats
    corners: list[Floats]


def cut(points: Floats, tetrahedra: NDArray[np.integer], values: Floats, axis: int, position: float) -> Cut:
    """Cut tetrahedra (m, 4) by the plane ``x[axis] = position``; values (n,) are interpolated along the cut edges."""
    # a node exactly in the plane counts as above it
    above = points[:, axis] >= position
    crossing = above[tetrahedra].any(axis=1) & ~above[tetrahedra].all(axis=1)
    elements = np.flatnonzero(crossing)
    polygons: list[Floats] = [np.empty((0, 2))] * len(elements)
    at_corners: list[Floats] = [np.empty(0)] * len(elements)
    means = np.empty(len(elements))
    corners_of = above[tetrahedra[elements]].sum(axis=1)
    # one node or three on a side make a triangle, two a quadrangle
    for count, rows in ((3, np.flatnonzero(corners_of != 2)), (4, np.flatnonzero(corners_of == 2))):
        corners, t, ends = _crossings(points, tetrahedra[elements[rows]][:, _EDGES], above, axis, position)
        corners, ends = corners.reshape(-1, count, 2), ends.reshape(-1, count, 2)
        x, y = np.moveaxis(corners - corners.mean(axis=1, keepdims=True), -1, 0)
        around = np.argsort(np.arctan2(y, x), axis=1)
        first, last = values[ends[..., 0]], values[ends[..., 1]]
        carried = np.take_along_axis(first + t.reshape(-1, count) * (last - first), around, axis=1)
        means[rows] = carried.mean(axis=1)
        for row, polygon, carries in zip(
            rows, np.take_along_axis(corners, around[..., None], axis=1), carried, strict=True
        ):
            polygons[row], at_corners[row] = polygon, carries
    return Cut(polygons, elements, means, at_corners)


def _crossings(
    points: Floats, edges: NDArray[np.integer], above: NDArray[np.bool_], axis: int, position: float
) -> tuple[Floats, Floats, NDArray[np.integer]]:
    """Of edges (k, e, 2) those that cross a plane: where in it, how far along, and their ends, one after another."""
    ends = edges[above[edges[..., 0]] != above[edges[..., 1]]]
    p, q = points[ends[:, 0]], points[ends[:, 1]]
    t = (position - p[:, axis]) / (q[:, axis] - p[:, axis])
    plane_axes = [k for k in range(3) if k != axis]
    return (p + t[:, None] * (q - p))[:, plane_axes], t, ends


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
    corners, _, _ = _crossings(points, crossed[:, _SIDES], above, axis, position)
    return corners.reshape(-1, 2, 2)
