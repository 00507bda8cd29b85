"""Plane cuts through a body of tetrahedra, as polygons that carry what their elements and nodes carry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Floats, Ints


@dataclass(frozen=True, eq=False)
class Cut:
    """A plane cut: the axis it is normal to, and a `pyvista.PolyData` of its polygons with what they carry."""

    axis: int
    section: Any
    #: Corners (3 or 4, 2) in the plane, in the two axes that are not cut; and the element (k,) of each polygon.
    polygons: list[Floats]
    elements: Ints
    #: Mean (k,) of the nodal values over the corners of each polygon.
    values: Floats


def cut(points: Floats, tetrahedra: NDArray[np.integer], values: Floats, axis: int, position: float) -> Cut:
    """Cut tetrahedra (m, 4) by the plane ``x[axis] = position``; values (n,) are interpolated along the cut edges."""
    import pyvista

    body = pyvista.UnstructuredGrid({pyvista.CellType.TETRA: tetrahedra}, np.array(points, dtype=np.float64))
    body.point_data["values"], body.cell_data["elements"] = values, np.arange(len(tetrahedra))
    section = _plane(body, axis, position)
    if not section.n_cells:
        return Cut(axis, section, [], np.zeros(0, dtype=np.int64), np.zeros(0))
    corners, polygons = np.delete(section.points, axis, axis=1), section.irregular_faces
    # PyVista looks for an array by name each time, which for every polygon takes longer than to cut
    at_corners, elements = np.asarray(section["values"]), np.asarray(section["elements"])
    means = np.array([at_corners[polygon].mean() for polygon in polygons])
    return Cut(axis, section, [corners[polygon] for polygon in polygons], elements, means)


def level_line(drawn: Cut, level: float) -> Floats:
    """Segments in the plane of a cut along which the values are at a level, shape (k, 2, 2)."""
    section = drawn.section
    return _segments(section.contour([level], scalars="values") if section.n_cells else section, drawn.axis)


def outline(points: Floats, faces: NDArray[np.integer], axis: int, position: float) -> Floats:
    """Segments in which triangles cross the plane ``x[axis] = position``, shape (k, 2, 2)."""
    import pyvista

    surface = pyvista.PolyData.from_regular_faces(np.array(points, dtype=np.float64), faces)
    return _segments(_plane(surface, axis, position), axis)


def _plane(body: Any, axis: int, position: float) -> Any:
    return body.slice(normal=np.eye(3)[axis], origin=position * np.eye(3)[axis])


def _segments(lines: Any, axis: int) -> Floats:
    ends = lines.lines.reshape(-1, 3)[:, 1:]
    return np.asarray(np.delete(lines.points, axis, axis=1)[ends]).reshape(-1, 2, 2)
