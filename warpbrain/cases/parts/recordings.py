"""The recordings of a case, each from its table and its file."""

from __future__ import annotations

from typing import Any

from warpbrain.cases.format.reading import Context, Reading
from warpbrain.cases.format.tables import RECORDING
from warpbrain.cases.parts.named import Named
from warpbrain.mesh import MeshInFile
from warpbrain.recordings.recording import RECORDINGS, Recording
from warpbrain.recordings.times import compared_rows


def read_recordings(
    context: Context, named: Named | None, in_file: MeshInFile | None, boundaries: set[str]
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
        kind = RECORDINGS[table.variant]
        if kind.of_specimen != specimen:
            other = "a case with [specimen]" if kind.of_specimen else "a case with [mesh]"
            table.problem("kind", f"'{table.variant}' belongs to {other}")
            continue
        recording = _read(table, kind, _given(table, kind, named, in_file, boundaries))
        if recording is not None:
            if not specimen and recording.reference is not None and not len(compared_rows(recording)):
                at = f"{recording.reference:g} s"
                table.problem("reference", f"no row is of another time than {at}: there is no difference to compare")
            recordings.append(recording)
    return tuple(recordings)


def _given(
    table: Reading, kind: type[Recording], named: Named | None, in_file: MeshInFile | None, boundaries: set[str]
) -> dict[str, Any] | None:
    """Path and keys as `Recording.read` takes them; None, and problems noted, if something of them is wrong."""
    given: dict[str, Any] = {"path": table.path("file")}
    given |= {key: table.get(key) for key in ("name", "file", "role")}
    right = given["path"] is not None and table.has("name")
    for key in kind.keys:
        value = table.si(key.name)
        if key.name == "nodes":
            value = None if named is None or in_file is None else named.nodes(table, in_file)
        elif key.name == "boundary" and value is not None and value not in boundaries:
            known = ", ".join(f"'{known}'" for known in sorted(boundaries)) or "none"
            table.problem("boundary", f"no [[boundary]] is called '{value}' (there are: {known})")
            right = False
        elif "file" in key.kinds:
            given[f"{key.name}_file"], value = value, table.path(key.name)
            right &= value is not None or not table.named(key.name)
        right &= value is not None or not key.needed
        given[key.name] = value
    sigma = table.get("sigma")
    return given | {"sigma": None if sigma is None else float(sigma)} if right else None


def _read(table: Reading, kind: type[Recording], given: dict[str, Any] | None) -> Recording | None:
    if given is None:
        return None
    if fault := kind.fault_of_keys(given):
        table.problem(*fault)
        return None
    recording = kind.read(frame=table.context.frame, problems=table.problems, **given)
    for key, fault in recording.without_meaning().items() if recording is not None else ():
        if table.named(key):
            table.problem(key, *fault)
    return recording
