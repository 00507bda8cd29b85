"""The recordings of a case, each from its table and its file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from warpbrain.cases.format.reading import Context, Reading
from warpbrain.cases.format.tables import RECORDING
from warpbrain.cases.parts.named import Named
from warpbrain.errors import InputError
from warpbrain.mesh import MeshInFile
from warpbrain.recordings.reading import read_force, read_points, read_surface, read_test
from warpbrain.recordings.recording import Recording, turn_of
from warpbrain.recordings.times import compared_rows


def read_recordings(
    context: Context, named: Named | None, found: MeshInFile | None, boundaries: set[str]
) -> tuple[Recording, ...]:
    """Recordings in the order of the file, as far as they are right; a force names one of the `boundaries`."""
    recordings: list[Recording] = []
    names: set[str] = set()
    specimen = "specimen" in context.tables
    for table in context.lists(RECORDING):
        name = table.get("name") or ""
        if name and name in names:
            table.problem("name", f"a second recording '{name}'")
        names.add(name)
        if table.variant is None:
            continue
        if (table.variant == "test") != specimen:
            other = "a case with [specimen]" if table.variant == "test" else "a case with [mesh]"
            table.problem("kind", f"'{table.variant}' belongs to {other}")
            continue
        common = _common(table)
        recording: Recording | None
        if table.variant == "surface":
            nodes = None if named is None or found is None else named.nodes(table, found)
            recording = None if common is None or nodes is None else read_surface(**common, nodes=nodes)
        elif table.variant == "points":
            recording = _points(table, common)
        elif table.variant == "force":
            recording = _force(table, common, boundaries)
        else:
            recording = _test(table, common)
        if recording is not None:
            recording = replace(recording, reference=table.get("reference"))
            if not specimen and recording.reference is not None and not len(compared_rows(recording)):
                at = f"{recording.reference:g} s"
                table.problem("reference", f"no row is of another time than {at}: there is no difference to compare")
            recordings.append(recording)
    return tuple(recordings)


def _common(table: Reading) -> dict[str, Any] | None:
    """What the readers of all kinds take; None if something of it is wrong."""
    path, sigma = table.path("file"), table.get("sigma")
    if path is None or not table.has("name"):
        return None
    scale = table.context.frame.metres if table.variant in ("points", "surface") else 1.0
    texts = {key: table.get(key) for key in ("name", "file", "role")}
    noise = None if sigma is None else scale * float(sigma)
    return {"path": path, "frame": table.context.frame, "problems": table.problems, "sigma": noise, **texts}


def _points(table: Reading, common: Mapping[str, Any] | None) -> Recording | None:
    moved = table.path("moved")
    if common is None or (table.named("moved") and moved is None):
        return None
    return read_points(**common, outside=table.get("outside"), moved=moved, moved_file=table.get("moved"))


def _force(table: Reading, common: Mapping[str, Any] | None, boundaries: set[str]) -> Recording | None:
    name = table.get("boundary")
    if name is not None and name not in boundaries:
        known = ", ".join(f"'{known}'" for known in sorted(boundaries)) or "none"
        table.problem("boundary", f"no [[boundary]] is called '{name}' (there are: {known})")
        return None
    return None if common is None or name is None else read_force(**common, boundary=name)


def _test(table: Reading, common: Mapping[str, Any] | None) -> Recording | None:
    if common is None or not table.has("mode"):
        return None
    axis, sheared = table.si("axis") or (0.0, 0.0, 1.0), table.si("sheared")
    try:
        turn_of(axis, sheared)
    except InputError as error:
        table.problem("axis" if sheared is None else "sheared", str(error))
        return None
    texts = {key: table.get(key) for key in ("mode", "stress", "unit", "control")}
    found = read_test(**common, **texts, specimen=table.get("specimen") or "")
    if found is None:
        return None
    for key in ("stress", "unit"):
        if table.named(key) and found.quantities[1] != "stress":
            table.problem(key, f"means nothing of {' and '.join(found.quantities)}", "it says what a column stress is")
    return replace(found, axis=axis, sheared=sheared)
