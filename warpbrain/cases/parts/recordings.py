"""The recordings of a case, each from its table and its file."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from warpbrain.cases.format.table import Reading
from warpbrain.cases.format.tables import RECORDING
from warpbrain.cases.parts.context import Context
from warpbrain.cases.parts.node_sets import NodeSets
from warpbrain.errors import InputError
from warpbrain.recordings.reading import read_force, read_points, read_surface, read_test
from warpbrain.recordings.recording import Recording, turn_of
from warpbrain.recordings.times import compared_rows


def read_recordings(context: Context, sets: NodeSets | None, boundaries: set[str]) -> tuple[Recording, ...]:
    """Recordings in the order of the file, as far as they are right; a force names one of the `boundaries`."""
    found: list[Recording] = []
    names: set[str] = set()
    specimen = "specimen" in context.tables
    for table in context.lists(RECORDING):
        name = table.get("name", "")
        if name and name in names:
            table.problem("name", f"a second recording '{name}'")
        names.add(name)
        if table.variant is None:
            continue
        if (table.variant == "test") != specimen:
            other = "a case with [specimen]" if table.variant == "test" else "a case with [mesh]"
            table.problem("kind", f"'{table.variant}' belongs to {other}")
            continue
        recording = _READERS[table.variant](context, table, sets, boundaries)
        if recording is not None:
            recording = replace(recording, reference=table.get("reference"))
            if not specimen and recording.reference is not None and not len(compared_rows(recording)):
                at = f"{recording.reference:g} s"
                table.problem("reference", f"no row is of another time than {at}: there is no difference to compare")
            found.append(recording)
    return tuple(found)


def _common(context: Context, table: Reading, scale: float) -> dict[str, Any] | None:
    path = context.path(table, "file")
    if path is None or not table.has("name"):
        return None
    sigma = table.get("sigma")
    return {
        "path": path,
        "frame": context.frame,
        "problems": context.problems,
        "name": table.get("name"),
        "file": table.get("file"),
        "role": table.get("role", "fit"),
        "sigma": None if sigma is None else scale * float(sigma),
    }


def _points(context: Context, table: Reading, sets: NodeSets | None, boundaries: set[str]) -> Recording | None:
    common = _common(context, table, context.frame.metres)
    moved = context.path(table, "moved")
    if common is None or (table.named("moved") and moved is None):
        return None
    return read_points(**common, outside=table.get("outside", "error"), moved=moved, moved_file=table.get("moved"))


def _surface(context: Context, table: Reading, sets: NodeSets | None, boundaries: set[str]) -> Recording | None:
    common = _common(context, table, context.frame.metres)
    nodes = None if sets is None else sets.look_up(table)
    if common is None or nodes is None:
        return None
    return read_surface(**common, nodes=nodes)


def _force(context: Context, table: Reading, sets: NodeSets | None, boundaries: set[str]) -> Recording | None:
    common = _common(context, table, 1.0)
    name = table.get("boundary")
    if name is not None and name not in boundaries:
        known = ", ".join(f"'{known}'" for known in sorted(boundaries)) or "none"
        table.problem("boundary", f"no [[boundary]] is called '{name}' (there are: {known})")
        return None
    if common is None or name is None:
        return None
    return read_force(**common, boundary=name)


def _test(context: Context, table: Reading, sets: NodeSets | None, boundaries: set[str]) -> Recording | None:
    common = _common(context, table, 1.0)
    if common is None or not table.has("mode"):
        return None
    axis, sheared = _direction(context, table, "axis"), _direction(context, table, "sheared")
    axis = axis or (0.0, 0.0, 1.0)
    try:
        turn_of(axis, sheared)
    except InputError as error:
        table.problem("axis" if sheared is None else "sheared", str(error))
        return None
    found = read_test(
        **common,
        mode=table.get("mode"),
        specimen=table.get("specimen", ""),
        stress=table.get("stress", "nominal"),
        unit=table.get("unit", "Pa"),
        control=table.get("control", "displacement"),
    )
    if found is None:
        return None
    for key in ("stress", "unit"):
        if table.named(key) and found.quantities[1] != "stress":
            table.problem(key, f"means nothing of {' and '.join(found.quantities)}", "it says what a column stress is")
    return replace(found, axis=axis, sheared=sheared)


def _direction(context: Context, table: Reading, key: str) -> tuple[float, float, float] | None:
    if not table.has(key):
        return None
    x, y, z = context.frame.directions(table.get(key)).tolist()
    return x, y, z


_READERS = {"points": _points, "surface": _surface, "force": _force, "test": _test}
