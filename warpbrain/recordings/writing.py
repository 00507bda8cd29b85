"""Writing of recordings, so that reading gives them back; whole or not at all."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from warpbrain.atomic import whole_file
from warpbrain.errors import InputError
from warpbrain.frame import Frame
from warpbrain.mesh.vtu import write_vtu
from warpbrain.recordings.reading import FORCE, NORMAL
from warpbrain.recordings.recording import (
    ForceRecording,
    PointsRecording,
    Recording,
    SurfaceRecording,
    TestRecording,
)
from warpbrain.recordings.tracked_points import DISPLACEMENT, POSITION

Floats = NDArray[np.float64]
Columns = dict[str, Floats | tuple[str, ...]]


def write_recording(path: Path, recording: Recording, frame: Frame) -> None:
    """Write a recording: a surface with triangles as ``.vtu``, everything else as ``.csv``.

    Numbers are written with all their digits: in metres reading gives the same ones back, in mm the same to rounding.
    What stands in `case.toml` (name, role, sigma, node set, boundary, mode) is not in the file.

    Parameters
    ----------
    path : Path
    recording : Recording
    frame : Frame
        Unit and axes of the file.

    Raises
    ------
    InputError
        If the ending is not that of such a recording, or the file cannot be written.
    """
    path = Path(path)
    if isinstance(recording, SurfaceRecording) and recording.faces is not None:
        _write_mesh(path, recording, frame)
        return
    _check_ending(path, ".csv", recording)
    if isinstance(recording, PointsRecording):
        columns = _points_columns(recording, frame)
    elif isinstance(recording, SurfaceRecording):
        columns = _vectors(POSITION, frame.file_lengths(recording.points)) | _time(recording.time)
        if recording.normals is not None:
            columns |= _vectors(NORMAL, frame.directions(recording.normals))
    elif isinstance(recording, ForceRecording):
        force = _vectors(FORCE, frame.directions(recording.force))
        columns = _time(recording.time) | {name: f for name, f in force.items() if not np.isnan(f).any()}
        if recording.torque is not None:
            columns["torque"] = recording.torque
    elif isinstance(recording, TestRecording):
        imposed, response = recording.quantities
        unit = frame.metres if imposed == "displacement" else 1.0
        columns = _time(recording.time) | {imposed: recording.imposed / unit, response: recording.response}
    else:
        raise InputError(f"{path}: found a {type(recording).__name__}, which has no file format")
    with whole_file(path) as scratch, scratch.open("w", encoding="utf-8", newline="") as file:
        file.write(",".join(columns) + "\n")
        csv.writer(file, lineterminator="\n", quoting=csv.QUOTE_NONNUMERIC).writerows(
            zip(*(column if isinstance(column, tuple) else column.tolist() for column in columns.values()), strict=True)
        )


def _points_columns(recording: PointsRecording, frame: Frame) -> Columns:
    columns: Columns = {}
    if recording.ids is not None:
        if any(not name.strip() or "\n" in name or "\r" in name for name in recording.ids):
            raise InputError(f"recording '{recording.name}': an id is empty or has a line break, and cannot be written")
        columns["id"] = recording.ids
    columns |= _time(recording.time) | _vectors(POSITION, frame.file_lengths(recording.points))
    columns |= _vectors(DISPLACEMENT, frame.file_lengths(recording.displacement))
    if recording.sigmas is not None:
        columns["sigma"] = recording.sigmas / frame.metres
    if recording.weights is not None:
        columns["weight"] = recording.weights
    return columns


def _write_mesh(path: Path, recording: SurfaceRecording, frame: Frame) -> None:
    import meshio

    _check_ending(path, ".vtu", recording)
    if recording.time is not None or recording.normals is not None:
        raise InputError(f"{path}: a surface with triangles is written without times and normals; leave them out")
    mesh = meshio.Mesh(frame.file_lengths(recording.points), [("triangle", recording.faces)])
    with whole_file(path) as scratch:
        write_vtu(scratch, mesh, frame.axes)


def _check_ending(path: Path, ending: str, recording: Recording) -> None:
    if path.suffix.lower() != ending:
        what = f"the {recording.kind} recording '{recording.name}'"
        raise InputError(f"{path}: {what} is written as {ending}, found '{path.suffix}'")


def _time(time: Floats | None) -> Columns:
    return {} if time is None else {"t": time}


def _vectors(names: Sequence[str], values: Floats) -> Columns:
    return dict(zip(names, values.T, strict=True))
