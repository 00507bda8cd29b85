"""Reading of recordings: one function a kind, each telling everything that is wrong with a file.

Lengths of a file are in the unit and axes of the case; Slicer markups and MNI tags have their own, which count for
them. Surface meshes that state their axes, as those of 3D Slicer do, are in these.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from warpbrain.frame import PASCALS, Frame
from warpbrain.problems import Problems
from warpbrain.recordings.markups import is_markup, read_markup
from warpbrain.recordings.recording import (
    ForceRecording,
    PointsRecording,
    SurfaceRecording,
    TestRecording,
)
from warpbrain.recordings.surfaces import read_surface_mesh
from warpbrain.recordings.tables import Table, read_table
from warpbrain.recordings.text import collected, shown
from warpbrain.recordings.tracked_points import POSITION, tracked_points

Floats = NDArray[np.float64]

NORMAL = ("nx", "ny", "nz")
FORCE = ("fx", "fy", "fz")
#: What a test of each mode may have recorded: imposed, response.
QUANTITIES = {
    "axial": (("displacement", "force"), ("stretch", "stress")),
    "shear": (("displacement", "force"),),
    "torsion": (("angle", "torque"),),
    "confined": (("displacement", "force"), ("stretch", "stress")),
    "biaxial": (("stretch", "stress"),),
}


def read_points(
    path: Path,
    frame: Frame,
    problems: Problems,
    *,
    name: str,
    file: str,
    role: str,
    sigma: float | None,
    outside: str,
    moved: Path | None = None,
    moved_file: str | None = None,
) -> PointsRecording | None:
    """Read tracked points from ``.csv``, ``.tag``, a pair of 3D Slicer markups (``.mrk.json``, ``.fcsv``), or an ending
    that another package reads (`tracked_points.Reader`).

    Parameters
    ----------
    path : Path
        A CSV file has columns ``x,y,z``, ``ux,uy,uz`` and perhaps ``t`` [s], ``id``, ``sigma`` and ``weight``.
    frame : Frame
        Unit and axes of a CSV file; ``.tag`` and markups are in mm and in their own axes.
    problems : Problems
        Gets what is wrong.
    name, file, role, outside, moved_file
        As in `PointsRecording`.
    sigma : float or None
        Noise of one component [m].
    moved : Path, optional
        Markup with the same labels where the points have gone; needed if `path` is a markup, and refused if not.

    Returns
    -------
    PointsRecording or None
        None if there were problems.
    """
    with collected(path, problems) as found:
        tracked = tracked_points(path, frame, moved, found)
        recording = None
        if tracked is not None and not found:
            recording = PointsRecording(
                name=name, file=file, role=role, sigma=sigma, outside=outside, moved_file=moved_file, **vars(tracked)
            )
    return recording


def read_surface(
    path: Path,
    frame: Frame,
    problems: Problems,
    *,
    name: str,
    file: str,
    role: str,
    sigma: float | None,
    nodes: str,
) -> SurfaceRecording | None:
    """Read points of a moved surface from ``.csv``, a 3D Slicer markup or a surface mesh.

    Parameters
    ----------
    path : Path
        A CSV file has columns ``x,y,z`` and perhaps ``t`` [s] and ``nx,ny,nz``; of a mesh (``.vtp``, ``.stl``,
        ``.ply``, ``.obj``, ``.vtu``, ...) points and triangles are taken.
    frame : Frame
        Unit and axes of the file; axes that a mesh states itself take precedence, and a markup is in mm and its own.
    problems, name, file, role
        As in `read_points`.
    sigma : float or None
        Noise of one component [m].
    nodes : str
        Name of the node set that was recorded.

    Returns
    -------
    SurfaceRecording or None
        None if there were problems.
    """
    points: Floats | None = None
    normals = faces = time = None
    with collected(path, problems) as found:
        if path.suffix.lower() == ".csv":
            table = read_table(path, found, (*POSITION, *NORMAL, "t"))
            if table is not None and table.require(*POSITION):
                points = frame.lengths(table.vectors(*POSITION))
                normals = _normals(table, frame)
                time = table.times(strictly=False) if "t" in table else None
        elif is_markup(path):
            markup = read_markup(path, found)
            points = markup.points if markup is not None else None
        else:
            mesh = read_surface_mesh(path, found)
            if mesh is not None:
                if mesh.axes not in (None, frame.axes):
                    found.remark(path, f"the file says that its axes are {mesh.axes}, which counts for it")
                points = Frame(frame.unit, mesh.axes or frame.axes).lengths(mesh.points)
                faces = mesh.faces
    if points is None or found:
        return None
    return SurfaceRecording(
        name=name,
        file=file,
        role=role,
        sigma=sigma,
        nodes=nodes,
        points=points,
        normals=normals,
        faces=faces,
        time=time,
    )


def read_force(
    path: Path,
    frame: Frame,
    problems: Problems,
    *,
    name: str,
    file: str,
    role: str,
    sigma: float | None,
    boundary: str,
) -> ForceRecording | None:
    """Read the resultant on a boundary from ``.csv``.

    Parameters
    ----------
    path : Path
        Columns ``t`` [s] and one or more of ``fx``, ``fy``, ``fz`` [N] and ``torque`` [N m].
    frame : Frame
        Axes of the force.
    problems, name, file, role
        As in `read_points`.
    sigma : float or None
        Noise of one component [N], or of the torque [N m] if that is all there is.
    boundary : str
        Name of the boundary.

    Returns
    -------
    ForceRecording or None
        None if there were problems.
    """
    with collected(path, problems) as found:
        table = _csv(path, found, ("t", *FORCE, "torque"))
        if table is None:
            return None
        recorded = [column for column in FORCE if column in table]
        if not recorded and "torque" not in table:
            table.require("fx")
        time = table.times(strictly=True) if table.require("t") else None
        force = np.full((len(table), 3), np.nan)
        for column in recorded:
            force[:, FORCE.index(column)] = table.numbers(column)
        torque = table.numbers("torque") if "torque" in table else None
    if time is None or found:
        return None
    return ForceRecording(
        name=name,
        file=file,
        role=role,
        sigma=sigma,
        boundary=boundary,
        time=time,
        force=frame.directions(force),
        torque=torque,
    )


def read_test(
    path: Path,
    frame: Frame,
    problems: Problems,
    *,
    name: str,
    file: str,
    role: str,
    sigma: float | None,
    mode: str,
    specimen: str = "",
    stress: str = "nominal",
    unit: str = "Pa",
    control: str = "displacement",
) -> TestRecording | None:
    """Read a laboratory test from ``.csv``.

    Parameters
    ----------
    path : Path
        Columns of one pair of `QUANTITIES` of the mode, and perhaps ``t`` [s]: ``displacement`` (in the unit of
        `frame`) and ``force`` [N], ``stretch`` and nominal ``stress`` [Pa], or ``angle`` [rad] and ``torque`` [N m].
    frame : Frame
        Unit of the displacement.
    problems, name, file, role
        As in `read_points`.
    sigma : float or None
        Noise of what the specimen answered, in the unit of its column.
    mode : {"axial", "shear", "torsion", "confined", "biaxial"}
    specimen : str
        Which one was tested, of several.
    stress : {"nominal", "cauchy"}
        What the column ``stress`` is; see `nominal_stress`.
    unit : str
        Of that column, of `PASCALS`.
    control : {"displacement", "force"}
        What the machine imposed.

    Returns
    -------
    TestRecording or None
        None if there were problems.
    """
    with collected(path, problems) as found:
        table = _csv(path, found, ("t", *(column for pair in QUANTITIES[mode] for column in pair)))
        pair = _pair(table, mode, found) if table is not None else None
        if table is None or pair is None:
            return None
        time = table.times(strictly=True) if "t" in table else None
        if pair[0] == "stretch":
            imposed = table.bounded("stretch", 0.0, itself=False)
        else:
            imposed = table.numbers(pair[0]) * (frame.metres if pair[0] == "displacement" else 1.0)
        response = table.numbers(pair[1])
        if pair[1] == "stress":
            response = PASCALS[unit] * nominal_stress(mode, imposed, response, stress)
    if found:
        return None
    of_answer = {"stress": PASCALS[unit], "displacement": frame.metres}.get(pair[control != "force"], 1.0)
    return TestRecording(
        name=name,
        file=file,
        role=role,
        sigma=None if sigma is None else of_answer * sigma,
        mode=mode,
        quantities=pair,
        imposed=imposed,
        response=response,
        time=time,
        specimen=specimen,
        control=control,
    )


def nominal_stress(mode: str, stretch: Floats, values: Floats, kind: str) -> Floats:
    """Force over the area at rest of a stress that a test reports.

    A Cauchy stress is a force over the area at that stretch: of an incompressible specimen, as evaluations of tests
    take it, that at rest over the stretch, so that `P = sigma / lambda`. Between the walls of a confining chamber the
    area stays.
    """
    if kind == "nominal" or mode == "confined":
        return values
    return np.asarray(values / stretch)


def _normals(table: Table, frame: Frame) -> Floats | None:
    """Unit normals (n, 3), RAS; all three columns or none of them."""
    if not any(column in table for column in NORMAL) or not table.require(*NORMAL):
        return None
    normals = frame.directions(table.vectors(*NORMAL))
    lengths = np.linalg.norm(normals, axis=1)
    for index in np.flatnonzero(lengths == 0.0):
        table.problem(int(index), "nx", "found a normal of length zero, expected a direction")
    return normals / np.where(lengths > 0.0, lengths, 1.0)[:, None]


def _csv(path: Path, problems: Problems, known: Sequence[str]) -> Table | None:
    if path.suffix.lower() != ".csv":
        problems.add(path, "", f"found ending {shown(path.suffix)}, expected .csv")
        return None
    return read_table(path, problems, known)


def _pair(table: Table, mode: str, problems: Problems) -> tuple[str, str] | None:
    """The pair of quantities that was recorded, if it is one."""
    known = QUANTITIES[mode]
    complete = [pair for pair in known if all(column in table for column in pair)]
    if len(complete) == 1:
        return complete[0]
    if complete:
        names = " and ".join(" with ".join(pair) for pair in complete)
        problems.add(table.path, "header", f"found {names}, expected one pair", "leave out or rename the other")
    else:
        table.require(*max(known, key=lambda pair: sum(column in table for column in pair)))
    return None
