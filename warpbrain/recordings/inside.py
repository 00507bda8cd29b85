"""Whether tracked points are in the mesh at all: where units and axes that were mixed up show first."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from warpbrain.mesh.quality import extent
from warpbrain.mesh.tet_mesh import TetMesh
from warpbrain.problems import Problems
from warpbrain.recordings.closest import closest_points
from warpbrain.recordings.comparison import faces_of_set
from warpbrain.recordings.location import Location, locate
from warpbrain.recordings.recording import PointsRecording, SurfaceRecording
from warpbrain.recordings.text import collected, shown

Floats = NDArray[np.float64]

#: What is tried on points most of which are outside: factor on x, y and z, and what it would mean.
_MISTAKES = (
    (
        (1000.0, 1000.0, 1000.0),
        "multiplied by 1000 most are inside: is one of mesh and recording in m, the other in mm?",
    ),
    ((0.001, 0.001, 0.001), "divided by 1000 most are inside: is one of mesh and recording in mm, the other in m?"),
    ((-1.0, -1.0, 1.0), "with the signs of x and y changed most are inside: is one of them in RAS, the other in LPS?"),
)
#: Of the extent of the mesh: points nearer together than this say nothing of a unit.
_DOT = 0.02
#: Of the size of the mesh: a surface farther away than this is not a moved surface of it.
_FAR = 0.25
#: Points that are enough to try it on.
_SAMPLE = 1000


def check_points_inside(
    recording: PointsRecording, mesh: TetMesh, path: Path, problems: Problems, location: Location | None = None
) -> Location:
    """Note as problems the points that are farther outside the mesh than an edge is long there.

    A recording with ``outside = "nearest"`` has no such problems. If most points are outside, that is one problem, and
    its cure says so if a factor of 1000 or the signs of RAS and LPS would bring most of them inside.

    Parameters
    ----------
    recording : PointsRecording
    mesh : TetMesh
        At rest.
    path : Path
        File of the recording.
    problems : Problems
    location : Location, optional
        Of the points in the mesh, if it is known already.

    Returns
    -------
    Location
        Of the points in the mesh.
    """
    place = locate(mesh.points, mesh.tetrahedra, recording.points) if location is None else location
    if recording.outside == "nearest":
        return place
    far = np.flatnonzero(place.distance > place.edge)
    inside = len(far) <= len(place) / 2
    if inside and recording.time is None and len(place) > 3 and _is_dot(recording.points, mesh):
        size = 1000.0 * float(np.ptp(recording.points, axis=0).max())
        problems.add(
            path,
            "",
            f"all {len(place)} points lie within {size:.3g} mm of each other, a dot in the body",
            "multiplied by 1000 they would not: is one of mesh and recording in m, the other in mm?",
        )
        return place
    if len(far) == 0:
        return place
    far = far[np.argsort(-place.distance[far], kind="stable")]
    cure = "" if inside else _mistake(recording.points[far], mesh)
    cure = cure or 'check units and axes, or write outside = "nearest" for this recording'
    with collected(path, problems) as found:
        named: set[str] = set()
        for row in far if inside else far[:1]:
            place_name = _name(recording, int(row))
            if place_name in named:
                continue
            head = f"the farthest of {len(far)} of {len(place)} points outside: " if not named and len(far) > 1 else ""
            named.add(place_name)
            x, y, z = 1000.0 * recording.points[row]
            at = f"({x:.4g}, {y:.4g}, {z:.4g}) mm RAS"
            limit = f"expected within one edge length, {1000.0 * place.edge[row]:.3g} mm"
            found.add(
                path, place_name, f"{head}{at} is {1000.0 * place.distance[row]:.4g} mm outside the mesh, {limit}", cure
            )
    return place


def _is_dot(points: Floats, mesh: TetMesh) -> bool:
    """Whether several points are so near each other that they can have been recorded in another unit only."""
    return extent(points) < _DOT * extent(mesh.points)


def check_surface_near(recording: SurfaceRecording, mesh: TetMesh, path: Path, problems: Problems) -> None:
    """Note as a problem a recorded surface that is nowhere near the faces that it is compared with."""
    faces = faces_of_set(mesh, recording.nodes, f"recording '{recording.name}'")
    sample = recording.points[:: -(-len(recording.points) // _SAMPLE)]
    limit = _FAR * extent(mesh.points)

    def away(points: Floats) -> float:
        return float(np.median(closest_points(points, mesh.points, faces).distance))

    distance = away(sample)
    cure = next((text for factors, text in _MISTAKES if away(sample * np.array(factors)) < 0.1 * distance), "")
    dot = len(sample) > 3 and _is_dot(sample, mesh)
    if distance > limit or (dot and cure):
        problems.add(
            path,
            "",
            f"most points are {1000.0 * distance:.4g} mm or more from the faces of '{recording.nodes}'"
            + (", all within a dot" if dot else ""),
            cure.replace("most are inside", "they are near") or "check units and axes",
        )


def _name(recording: PointsRecording, row: int) -> str:
    return f"point {row + 1}" if recording.ids is None else f"id {shown(recording.ids[row])}"


def _mistake(points: Floats, mesh: TetMesh) -> str:
    """The mistake that, undone, brings most points inside; empty if none does."""
    sample = points[:: -(-len(points) // _SAMPLE)]
    shares = []
    for factors, _ in _MISTAKES:
        undone = sample * np.array(factors)
        place = locate(mesh.points, mesh.tetrahedra, undone)
        # shrunk to a dot, any points lie inside a body that holds the origin: that tells nothing
        shares.append(0.0 if _is_dot(undone, mesh) else float(np.mean(place.distance <= place.edge)))
    best = int(np.argmax(shares))
    return _MISTAKES[best][1] if shares[best] > 0.5 else ""
