"""Writes a case folder that reads back as the same case."""

import itertools
import math
import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.atomic import output_folder, safe_name, write_text
from warpbrain.cases.boundary import Boundary, Contact, Displaced
from warpbrain.cases.case import Case, Tissue
from warpbrain.cases.format.tables import BODY, BOUNDARY, CASE, MECHANISM, PRIOR, RECORDING, TISSUE
from warpbrain.errors import InputError, require_kind
from warpbrain.frame import Frame
from warpbrain.keys import Table
from warpbrain.mesh import write_mesh
from warpbrain.physics.mechanism import ClosedSurface, Facts, Mechanism, Removing
from warpbrain.recordings.base import DISPLACEMENT, Columns, Recording, write_columns, write_triangles

_HEAD = "# A case of warpbrain. What its tables and keys mean: docs/case-format.md.\n\n"


def write_case(folder: str | os.PathLike[str], case: Case) -> Path:
    """Write a case as `folder/case.toml` with its mesh and recordings, in the case's own units and axes.

    Parameters
    ----------
    folder : path
        Made if it is not there. A folder that holds a `case.toml` is refused: nothing is overwritten.
    case : Case

    Returns
    -------
    Path
        The `case.toml`, written last.

    Raises
    ------
    InputError
        If the folder holds a case already or cannot be written to.
    """
    require_kind(folder, (str, os.PathLike), "folder", "the path of a folder")
    require_kind(case, Case, "case", "a Case, as warpbrain.find_case gives")
    folder = Path(folder)
    target = folder / "case.toml"
    if target.exists():
        raise InputError(f"{target}: there is a case already; write to another folder")
    output_folder(folder)
    frame = case.frame
    given = {**vars(case), "registration": None, "units": frame.unit, "axes": frame.axes}
    tables: dict[str, Any] = {"case": _values(CASE, "", given, frame)}
    if case.registration is not None:
        shift, turn = case.registration.shift, case.registration.turn
        tables["case"]["registration"] = {"mm": shift / 0.001, "degrees": math.degrees(turn)}
    if case.specimen is not None:
        x, y, z = (length / frame.metres for length in case.specimen.size)
        size = {"radius": 0.5 * x, "height": z} if case.specimen.shape == "cylinder" else {"size": [x, y, z]}
        tables["specimen"] = {"shape": case.specimen.shape, **size, "grips": case.specimen.grips}
    else:
        name = Path(case.mesh_file).with_suffix(".vtu").name
        tables["mesh"] = {"file": name, "tissue": "tissue"}
        turned = {name: frame.directions(vectors) for name, vectors in case.mesh.element_vectors.items()}
        in_axes = replace(case.mesh, points=frame.directions(case.mesh.points), element_vectors=turned)
        write_mesh(folder / name, in_axes, unit=frame.unit, axes=frame.axes)
    tables["tissue"] = {str(label): _tissue(tissue, frame) for label, tissue in sorted(case.tissues.items())}
    tables["body"] = _values(BODY, "", vars(case), frame)
    if case.boundaries:
        tables["boundary"] = [_boundary(folder, boundary, frame) for boundary in case.boundaries]
    if case.mechanisms:
        removing = tuple(mechanism for mechanism in case.mechanisms if isinstance(mechanism, Removing))
        facts = Facts(case.mesh, case.gravity_axis, case.density, removing)
        tables["mechanism"] = [_mechanism(folder, mechanism, facts, frame) for mechanism in case.mechanisms]
    if case.recordings:
        tables["recording"] = [_recording(folder, recording, frame) for recording in case.recordings]
    import tomli_w

    write_text(target, _HEAD + tomli_w.dumps(tables))
    return target


def _values(table: Table, variant: str, given: Mapping[str, Any], frame: Frame) -> dict[str, Any]:
    """Keys of a table as a file has them, of what is given in SI units and RAS axes and is not None or empty."""
    keys = table.keys_of(variant)
    return {name: key.in_file(given[name], frame) for name, key in keys.items() if given.get(name) not in (None, ())}


def _tissue(tissue: Tissue, frame: Frame) -> dict[str, Any]:
    law = {"mu": PRIOR} if tissue.law is None else {key: getattr(tissue.law, key) for key in tissue.law.keys}
    given = {**vars(tissue), **law, "prior": tissue.prior or None}
    head = {"name": tissue.name, "model": tissue.model, "formulation": tissue.formulation}
    return {**head, **law, **_values(TISSUE, tissue.model, given, frame)}


def _boundary(folder: Path, boundary: Boundary, frame: Frame) -> dict[str, Any]:
    given: dict[str, Any] = {"kind": boundary.kind, **vars(boundary)}
    if isinstance(boundary, Displaced):
        given["value"] = boundary.values[0]
        if boundary.has_history:
            given["value"] = _new_file(folder, "boundaries", boundary.name, ".csv")
            columns: Columns = {"t": np.array(boundary.times), DISPLACEMENT: frame.file_lengths(boundary.values)}
            write_columns(folder / given["value"], columns)
    if isinstance(boundary, Contact):
        given["surface"] = _surface(folder, boundary.surface, boundary.name, frame)
    return {"name": boundary.name, "nodes": boundary.nodes} | _values(BOUNDARY, boundary.kind, given, frame)


def _surface(folder: Path, surface: ClosedSurface, name: str, frame: Frame) -> str:
    """Write a closed surface; its file, relative to the folder."""
    file = _new_file(folder, "surfaces", name, ".vtu")
    write_triangles(folder / file, surface.points, surface.faces, frame)
    return file


def _mechanism(folder: Path, mechanism: Mechanism, facts: Facts, frame: Frame) -> dict[str, Any]:
    given = {"kind": mechanism.kind, **mechanism.in_case(facts), "ramp": mechanism.ramp}
    for name, value in given.items():
        if isinstance(value, ClosedSurface):
            given[name] = _surface(folder, value, Path(value.file).stem, frame)
    return _values(MECHANISM, mechanism.kind, given, frame)


def _recording(folder: Path, recording: Recording, frame: Frame) -> dict[str, Any]:
    name = _new_file(folder, "recordings", recording.name, recording.ending)
    recording.write(folder / name, frame)
    given = {**recording.in_case(), "kind": recording.kind, "file": name}
    if recording.sigma is not None:
        given["sigma"] = recording.sigma / (frame.metres if recording.noise_unit == "m" else 1.0)
    return {"name": recording.name} | _values(RECORDING, recording.kind, given, frame)


def _new_file(folder: Path, room: str, name: str, ending: str) -> str:
    """A file of the case that is not there yet, relative to its folder, named after free text; its room is made."""
    (folder / room).mkdir(exist_ok=True)
    # disks that do not tell A from a
    taken = {path.name.casefold() for path in (folder / room).iterdir()}
    stem = safe_name(name)
    names = (f"{stem}{'' if number == 1 else f'-{number}'}{ending}" for number in itertools.count(1))
    return f"{room}/{next(name for name in names if name.casefold() not in taken)}"
