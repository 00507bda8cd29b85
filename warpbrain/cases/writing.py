"""Writes a case folder that reads back as the same case."""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.atomic import output_folder, safe_name, whole_file
from warpbrain.cases.boundary import Boundary, Contact, Displaced, Fixed, Forced, Pressed, Sliding
from warpbrain.cases.case import Case, Tissue
from warpbrain.cases.format.tables import PRIOR
from warpbrain.cases.parts.mechanisms import in_file
from warpbrain.errors import InputError, require_kind
from warpbrain.frame import Frame
from warpbrain.mesh import write_mesh
from warpbrain.mesh.vtu import write_vtu
from warpbrain.physics.mechanism import ClosedSurface, Facts, Mechanism, Removing
from warpbrain.recordings.recording import (
    ForceRecording,
    PointsRecording,
    Recording,
    SurfaceRecording,
    TestRecording,
)
from warpbrain.recordings.writing import write_recording

#: The schema that editors check a case.toml with; see `warpbrain.cases.format.schema`.
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
    tables: dict[str, Any] = {"case": _head(case)}
    if case.specimen is not None:
        tables["specimen"] = _specimen(case)
    else:
        name = Path(case.mesh_file).with_suffix(".vtu").name
        tables["mesh"] = {"file": name, "tissue": "tissue"}
        turned = {name: frame.directions(vectors) for name, vectors in case.mesh.element_vectors.items()}
        in_axes = replace(case.mesh, points=frame.directions(case.mesh.points), element_vectors=turned)
        write_mesh(folder / name, in_axes, unit=frame.unit, axes=frame.axes)
    tables["tissue"] = {str(label): _tissue(tissue) for label, tissue in sorted(case.tissues.items())}
    tables["body"] = {"density": case.density, "poisson": case.poisson}
    if case.boundaries:
        tables["boundary"] = [_boundary(folder, boundary, frame) for boundary in case.boundaries]
    if case.mechanisms:
        removing = tuple(mechanism for mechanism in case.mechanisms if isinstance(mechanism, Removing))
        facts = Facts(case.mesh, case.gravity_axis, case.density, removing)
        tables["mechanism"] = [_mechanism(folder, mechanism, facts, frame) for mechanism in case.mechanisms]
    if case.recordings:
        tables["recording"] = [_recording(folder, recording, frame) for recording in case.recordings]
    import tomli_w

    with whole_file(target) as temporary:
        temporary.write_text(_HEAD + tomli_w.dumps(tables), encoding="utf-8")
    return target


def _head(case: Case) -> dict[str, Any]:
    head: dict[str, Any] = {"name": case.name, "title": case.title, "origin": case.origin}
    head |= {"units": case.frame.unit, "axes": case.frame.axes}
    if case.gravity_axis is not None:
        head["gravity_axis"] = _plain(case.frame.directions(case.gravity_axis))
    if case.registration is not None:
        shift, turn = case.registration.shift, case.registration.turn
        head["registration"] = {"mm": shift / 0.001, "degrees": math.degrees(turn)}
    return head


def _specimen(case: Case) -> dict[str, Any]:
    assert case.specimen is not None
    x, y, z = (length / case.frame.metres for length in case.specimen.size)
    shape = {"radius": 0.5 * x, "height": z} if case.specimen.shape == "cylinder" else {"size": [x, y, z]}
    return {"shape": case.specimen.shape, **shape, "grips": case.specimen.grips}


def _tissue(tissue: Tissue) -> dict[str, Any]:
    law: dict[str, Any] = {"mu": PRIOR}
    if tissue.law is not None:
        law = {key: _plain(getattr(tissue.law, key)) for key in tissue.law.keys}
    prior = {"prior": tissue.prior} if tissue.prior else {}
    known = {} if tissue.accuracy is None else {"accuracy": tissue.accuracy}
    return {"name": tissue.name, "model": tissue.model, "formulation": tissue.formulation, **law, **prior, **known}


def _boundary(folder: Path, boundary: Boundary, frame: Frame) -> dict[str, Any]:
    table: dict[str, Any] = {"name": boundary.name, "nodes": boundary.nodes, "kind": boundary.kind}
    if isinstance(boundary, Displaced):
        return table | _displacement(folder, boundary, frame)
    if isinstance(boundary, Forced):
        return table | {"total": _plain(frame.directions(boundary.total)), **_ramp(boundary.ramp)}
    if isinstance(boundary, Pressed):
        return table | {"value": boundary.value, **_ramp(boundary.ramp)}
    if isinstance(boundary, Contact):
        name = _surface(folder, boundary.surface, boundary.name, frame)
        return table | {"surface": name, "friction": boundary.friction}
    assert isinstance(boundary, Fixed | Sliding)
    return table


def _ramp(ramp: Any) -> dict[str, Any]:
    return {"ramp": _plain(ramp)} if ramp else {}


def _displacement(folder: Path, boundary: Displaced, frame: Frame) -> dict[str, Any]:
    values = frame.file_lengths(boundary.values)
    if not boundary.has_history:
        return {"value": _plain(values[0])}
    name = _new_file(folder, "boundaries", boundary.name, ".csv")
    rows = "".join(
        ",".join(repr(float(v)) for v in (time, *value)) + "\n"
        for time, value in zip(boundary.times, values, strict=True)
    )
    with whole_file(folder / name) as temporary:
        temporary.write_text("t,ux,uy,uz\n" + rows, encoding="utf-8")
    return {"value": name}


def _surface(folder: Path, surface: ClosedSurface, name: str, frame: Frame) -> str:
    """Write a closed surface; its file, relative to the folder."""
    import meshio

    file = _new_file(folder, "surfaces", name, ".vtu")
    with whole_file(folder / file) as temporary:
        mesh = meshio.Mesh(frame.file_lengths(surface.points), [("triangle", surface.faces)])
        write_vtu(temporary, mesh, frame.axes)
    return file


def _mechanism(folder: Path, mechanism: Mechanism, facts: Facts, frame: Frame) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for name, value in mechanism.in_case(facts).items():
        if isinstance(value, ClosedSurface):
            values[name] = _surface(folder, value, Path(value.file).stem, frame)
        else:
            values[name] = in_file(mechanism.parameters()[name], value, frame)
    return {"kind": mechanism.kind, **values, **_ramp(mechanism.ramp)}


def _recording(folder: Path, recording: Recording, frame: Frame) -> dict[str, Any]:
    ending = ".vtu" if getattr(recording, "faces", None) is not None else ".csv"
    name = _new_file(folder, "recordings", recording.name, ending)
    table: dict[str, Any] = {"name": recording.name, "kind": recording.kind, "file": name, "role": recording.role}
    length = isinstance(recording, PointsRecording | SurfaceRecording)
    if isinstance(recording, TestRecording):
        length = recording.answer[0] == "displacement"
    if recording.sigma is not None:
        table["sigma"] = recording.sigma / (frame.metres if length else 1.0)
    more: dict[type[Recording], Callable[[Any], dict[str, Any]]] = {
        PointsRecording: lambda r: {"outside": r.outside},
        SurfaceRecording: lambda r: {"nodes": r.nodes},
        ForceRecording: lambda r: {"boundary": r.boundary},
        TestRecording: lambda r: _test(r, frame),
    }
    if recording.reference is not None:
        table["reference"] = recording.reference
    write_recording(folder / name, replace(recording, file=name), frame)
    return table | more[type(recording)](recording)


def _test(recording: TestRecording, frame: Frame) -> dict[str, Any]:
    table: dict[str, Any] = {"mode": recording.mode}
    if recording.force_controlled:
        table["control"] = recording.control
    if recording.specimen:
        table["specimen"] = recording.specimen
    if recording.axis != (0.0, 0.0, 1.0):
        table["axis"] = frame.directions(recording.axis).tolist()
    if recording.sheared is not None:
        table["sheared"] = frame.directions(recording.sheared).tolist()
    return table


def _new_file(folder: Path, room: str, name: str, ending: str) -> str:
    """A file of the case that is not there yet, relative to its folder, named after free text; its room is made."""
    (folder / room).mkdir(exist_ok=True)
    # disks that do not tell A from a
    taken = {path.name.casefold() for path in (folder / room).iterdir()}
    stem = safe_name(name)
    names = (f"{stem}{'' if number == 1 else f'-{number}'}{ending}" for number in itertools.count(1))
    return f"{room}/{next(name for name in names if name.casefold() not in taken)}"


def _plain(value: Any) -> Any:
    """Python's numbers and lists of NumPy's and tuples."""
    if isinstance(value, np.ndarray | tuple | list):
        return [_plain(item) for item in value]
    return float(value) if isinstance(value, float | np.floating) else value
