"""What cannot have been recorded of a body, known before anything is computed: units and axes that were mixed up."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.mesh.free_surfaces import faces_of_set
from warpbrain.mesh.quality import extent
from warpbrain.mesh.tet_mesh import TetMesh
from warpbrain.problems import Problems
from warpbrain.recordings.base import TrackedPoints
from warpbrain.recordings.closest import closest_points
from warpbrain.recordings.location import locate
from warpbrain.recordings.text import collected, shown

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
#: Least noise of a recording, relative to the extent of the mesh: 0.1 um of a brain, finer than anything measures.
_FINEST = 1e-6
_FAR_MOVED = "are the units right, and are ux, uy, uz how far it went and not where?"
#: Points that are enough to try it on.
_SAMPLE = 1000


def check_possible(
    mesh: TetMesh,
    path: Path,
    problems: Problems,
    noises: Sequence[float | Floats | None],
    displacement: Floats | None = None,
) -> None:
    """Note as problems points that move (n, 3) [m] farther than the body is long, and noise [m] that nothing has.

    That is larger than the body, or less than a millionth of it.
    """
    size = extent(mesh.points)
    moved = np.zeros(0) if displacement is None else np.linalg.norm(displacement, axis=1)
    with collected(path, problems) as of_file:
        for row in np.flatnonzero(moved > size):
            message = f"moves {_metres(float(moved[row]))} in a body of {_metres(size)}"
            of_file.add(path, f"point {row + 1}", message, _FAR_MOVED)
        declared = np.concatenate([np.zeros(0), *(np.ravel(noise) for noise in noises if noise is not None)])
        impossible = declared[(declared > size) | (declared < _FINEST * size)]
        if len(impossible):
            message = f"a noise of {_metres(float(impossible.min()))} in a body of {_metres(size)}"
            of_file.add(path, "sigma", message, "in units of the case, one standard deviation of one component")


def _metres(length: float) -> str:
    return f"{length:.3g} m" if length >= 1.0 else f"{1000.0 * length:.3g} mm"


def check_points_inside(recording: TrackedPoints, mesh: TetMesh, path: Path, problems: Problems) -> None:
    """Note as problems the points that are farther outside the mesh at rest than an edge is long there.

    If most points are outside, that is one problem, and its cure says so if a factor of 1000 or the signs of RAS and
    LPS would bring most of them inside.
    """
    points = recording.points
    place = locate(mesh.points, mesh.tetrahedra, points)
    far = np.flatnonzero(place.distance > place.edge)
    far = far[np.argsort(-place.distance[far], kind="stable")]
    inside = len(far) <= len(place) / 2
    dot = len(place) > 3 and _is_dot(points, mesh) and not _is_dot(1000.0 * points, mesh)
    if inside and recording.time is None and dot:
        size = 1000.0 * float(np.ptp(points, axis=0).max())
        message = f"all {len(place)} points lie within {size:.3g} mm of each other, a dot in the body"
        cure = "multiplied by 1000 they would not: is one of mesh and recording in m, the other in mm?"
        problems.add(path, "", message, cure)
        return
    cure = "" if inside else _mistake(points[far], mesh)
    cure = cure or 'check units and axes, or write outside = "nearest" for this recording'
    farthest: dict[str, int] = {}
    for row in (far if inside else far[:1]).tolist():
        name = f"point {row + 1}" if recording.ids is None else f"id {shown(recording.ids[row])}"
        farthest.setdefault(name, row)
    head = f"the farthest of {len(far)} of {len(place)} points outside: " if len(far) > 1 else ""
    with collected(path, problems) as of_file:
        for name, row in farthest.items():
            x, y, z = 1000.0 * points[row]
            at = f"({x:.4g}, {y:.4g}, {z:.4g}) mm RAS is {1000.0 * place.distance[row]:.4g} mm outside the mesh"
            limit = f"expected within one edge length, {1000.0 * place.edge[row]:.3g} mm"
            of_file.add(path, name, f"{head}{at}, {limit}", cure)
            head = ""


def _is_dot(points: Floats, mesh: TetMesh) -> bool:
    """Whether several points are so near each other that they can have been recorded in another unit only."""
    return extent(points) < _DOT * extent(mesh.points)


def check_surface_near(
    points: Floats, mesh: TetMesh, nodes: str, recording: str, path: Path, problems: Problems
) -> None:
    """Note as a problem points (n, 3) of a surface that are nowhere near `faces_of_set`."""
    faces = faces_of_set(mesh, nodes, recording)
    sample = points[:: -(-len(points) // _SAMPLE)]
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
            f"most points are {1000.0 * distance:.4g} mm or more from the faces of '{nodes}'"
            + (", all within a dot" if dot else ""),
            cure.replace("most are inside", "they are near") or "check units and axes",
        )


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
