"""Reads a case folder, checking everything before anything is computed."""

import math
import os
from pathlib import Path

from warpbrain.cases.case import Case
from warpbrain.cases.format.reading import Context, parse_toml
from warpbrain.cases.format.tables import CASE, TABLES
from warpbrain.cases.parts.anatomy import read_anatomy
from warpbrain.cases.parts.boundaries import check_faces, check_together, read_boundaries
from warpbrain.cases.parts.mechanisms import read_mechanisms
from warpbrain.cases.parts.named import Named
from warpbrain.cases.parts.recordings import check_magnitudes, read_recordings
from warpbrain.cases.parts.tissues import read_body, read_tissues
from warpbrain.errors import InputError, require_kind
from warpbrain.frame import Frame
from warpbrain.physics.composition import CompositionError, require_composable, require_left
from warpbrain.problems import Problems, nearest
from warpbrain.recordings.base import Registration


def read_case(path: str | os.PathLike[str]) -> Case:
    """Read a case.

    Parameters
    ----------
    path : path
        A `case.toml`, or the folder that holds it.

    Raises
    ------
    InputError
        If anything in it is wrong: the file, the key or row, what was found and what was expected.
    """
    require_kind(path, (str, os.PathLike), "path", "the path of a case.toml or its folder")
    problems = Problems()
    case = examine_case(Path(path), problems)
    problems.stop(Path(path) if Path(path).is_dir() else Path(path).parent)
    assert case is not None  # nothing was wrong
    return case


def examine_case(path: Path, problems: Problems) -> Case | None:
    """Read a case and note all that is wrong with it; None if too much is for a case to be there."""
    file = path / "case.toml" if path.is_dir() else path
    tables = parse_toml(file, problems)
    if tables is None:
        return None
    context = Context(file, tables, problems)
    names = [table.name for table in TABLES]
    for name in tables:
        if name not in names:
            problems.add(file, name, "unknown key", nearest(name, names))
    head = context.table(CASE)
    context.frame = Frame(head.get("units"), head.get("axes"))
    axis = head.si("gravity_axis")
    if axis is not None and not any(axis):
        head.problem("gravity_axis", f"expected 3 numbers that are not all zero, found {head.get('gravity_axis')}")
        axis = None
    registration = None
    if accuracy := head.get("registration"):
        registration = Registration(0.001 * accuracy["mm"], math.radians(accuracy["degrees"]))

    mesh_file, in_file, specimen = read_anatomy(context)
    context.mesh = None if in_file is None else in_file.mesh
    tissues = read_tissues(context)
    density, poisson, heterogeneity = read_body(context)
    named = None if in_file is None else Named(in_file.mesh, tissues, context.frame, problems, in_file)
    boundaries = read_boundaries(context, named)
    mechanisms = read_mechanisms(context, named, axis, density)
    recordings = read_recordings(context, named, {boundary.name for boundary in boundaries})
    if named is None:
        return None
    # with the sets and vectors that keys name
    mesh = named.mesh
    case = Case(
        name=head.get("name") or "",
        title=head.get("title" if head.has("title") else "name") or "",
        origin=head.get("origin") or "",
        path=file,
        frame=context.frame,
        gravity_axis=axis,
        registration=registration,
        mesh=mesh,
        mesh_file=mesh_file,
        specimen=specimen,
        tissues=tissues,
        density=density,
        poisson=poisson,
        heterogeneity=heterogeneity,
        boundaries=boundaries,
        mechanisms=mechanisms,
        recordings=recordings,
        remarks=tuple(problems.remarks),
    )
    if specimen is None:
        check_together(context, mesh, boundaries)
    else:
        check_magnitudes(context, specimen, tissues, poisson, recordings)
    try:
        require_composable(mechanisms, require_left(mechanisms, mesh))
    except CompositionError as error:
        problems.add(file, "[[mechanism]]", str(error), "see docs/mechanisms/pairs.md")
    left = case.remaining[0]
    check_faces(context, left, boundaries)
    for recording in recordings:
        try:
            recording.check(left, file.parent / recording.file, problems)
        except InputError as error:  # the set has no face
            problems.add(file, "[[recording]]", str(error))
    return case
