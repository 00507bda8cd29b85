"""Plane cuts through a body of tetrahedra, as polygons that carry what their elements and nodes carry."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Floats, Ints


@dataclass(frozen=True, eq=False)
class Section:
    """Where something that is linear in simplices is zero: points on their edges, and polygons of these."""

    #: Nodes (p, 2) of the edge that each point is on, and the weight (p,) of the second.
    edges: Ints
    weights: Floats
    #: Simplex (k,) of each polygon, and its corners in their order (k, 4), or (k, 2) of a segment: points, -1 for none.
    cells: Ints
    corners: Ints

    def at_points(self, values: Floats) -> Floats:
        """Nodal values (n, ...) at the points (p, ...)."""
        first, second = values[self.edges[:, 0]], values[self.edges[:, 1]]
        return first + (self.weights * (second - first).T).T

    @property
    def triangles(self) -> Ints:
        """The polygons, cut into triangles (t, 3) of points."""
        four = self.corners[self.corners[:, 3] >= 0]
        return np.concatenate([self.corners[:, :3], four[:, [0, 2, 3]]])


def section_of(heights: Floats, simplices: NDArray[np.integer]) -> Section:
    """Where triangles (m, 3) or tetrahedra (m, 4) are cut by the zero of nodal heights (n,).

    A node at height zero is taken for one above it.
    """
    size = simplices.shape[1]
    below = heights[simplices] < 0.0
    above = size - below.sum(axis=1)
    cells = np.flatnonzero((above > 0) & (above < size))
    above = above[cells]
    # those above come before those below
    order = np.argsort(below[cells], axis=1, kind="stable")
    nodes = np.take_along_axis(simplices[cells], order, axis=1)
    ends = np.full((len(cells), size * size // 4, 2), -1)
    for count in range(1, size):
        pairs = [(i, j) for i in range(count) for j in range(count, size)]
        if len(pairs) == 4:
            # around a quadrilateral
            pairs[2:] = pairs[:1:-1]
        ends[above == count, : len(pairs)] = nodes[above == count][:, pairs]
    there = ends[:, :, 0] >= 0
    edges, number = np.unique(np.sort(ends[there], axis=1), axis=0, return_inverse=True)
    corners = np.full(there.shape, -1)
    corners[there] = number.ravel()
    first, second = heights[edges[:, 0]], heights[edges[:, 1]]
    return Section(edges, first / (first - second), cells, corners)


def plane_section(points: Floats, simplices: NDArray[np.integer], axis: int, position: float) -> Section:
    """Where simplices are cut by the plane ``x[axis] = position``; its polygons turn the same way."""
    section = section_of(points[:, axis] - position, simplices)
    if simplices.shape[1] == 4:
        corners, places = section.corners, section.at_points(np.delete(points, axis, axis=1))
        a, b, c, d = places[np.where(corners < 0, corners[:, :1], corners)].transpose(1, 2, 0)
        # the product of diagonals is twice the area; of a triangle, too
        turned = np.flatnonzero((c - a)[0] * (d - b)[1] < (c - a)[1] * (d - b)[0])
        last = 2 + (corners[turned, 3] >= 0)
        corners[turned, 1], corners[turned, last] = corners[turned, last], corners[turned, 1]
    return section


@dataclass(frozen=True, eq=False)
class Cut:
    """A plane cut: polygons, and points of which they are made, in the two axes that are not cut."""

    #: Corners (3 or 4, 2); the element (k,) of each polygon; mean (k,) of the nodal values over its corners.
    polygons: list[Floats]
    elements: Ints
    values: Floats
    #: Points (p, 2), triangles (t, 3) of these, and the values (p,) there.
    points: Floats
    triangles: Ints
    at_points: Floats


def cut(points: Floats, tetrahedra: NDArray[np.integer], values: Floats, axis: int, position: float) -> Cut:
    """Cut tetrahedra (m, 4) by the plane ``x[axis] = position``; values (n,) are interpolated along the cut edges."""
    section = plane_section(points, tetrahedra, axis, position)
    places, there = section.at_points(np.delete(points, axis, axis=1)), section.corners >= 0
    at_points = section.at_points(np.asarray(values, dtype=np.float64))
    polygons = [places[corners[seen]] for corners, seen in zip(section.corners, there, strict=True)]
    means = np.where(there, at_points[section.corners], 0.0).sum(axis=1) / there.sum(axis=1)
    return Cut(polygons, section.cells, means, places, section.triangles, at_points)


def level_line(drawn: Cut, level: float) -> Floats:
    """Segments in the plane of a cut along which the values are at a level, shape (k, 2, 2)."""
    line = section_of(drawn.at_points - level, drawn.triangles)
    return line.at_points(drawn.points)[line.corners]


def outline(points: Floats, faces: NDArray[np.integer], axis: int, position: float) -> Floats:
    """Segments in which triangles cross the plane ``x[axis] = position``, shape (k, 2, 2)."""
    line = plane_section(points, faces, axis, position)
    return line.at_points(np.delete(points, axis, axis=1))[line.corners]
