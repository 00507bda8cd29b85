"""Closed surfaces from files, such as the inside of a skull."""

from __future__ import annotations

from pathlib import Path

from warpbrain.frame import Frame
from warpbrain.mesh.soundness import open_edges
from warpbrain.physics.mechanism import ClosedSurface
from warpbrain.problems import Problems
from warpbrain.recordings.surfaces import read_surface_mesh


def read_closed_surface(path: Path, name: str, frame: Frame, problems: Problems) -> ClosedSurface | None:
    """The surface in a file, in metres and RAS, called by a name; None if it is none or is not closed."""
    surface = read_surface_mesh(path, problems)
    if surface is None:
        return None
    if surface.faces is None:
        problems.add(path, "", "found points only, expected a surface of triangles")
        return None
    edges = open_edges(surface.faces)
    if len(edges):
        problems.add(
            path,
            "",
            f"the surface is not closed: {len(edges)} edge(s) do not belong to two triangles, first that of the "
            f"points {edges[0][0]} and {edges[0][1]}",
            "contact needs an inside: close the surface",
        )
        return None
    points = Frame(frame.unit, surface.axes or frame.axes).lengths(surface.points)
    return ClosedSurface(name, points, surface.faces)
