"""Control points of 3D Slicer markups, ``.mrk.json`` and ``.fcsv``: positions and labels, and the file with others.

Both kinds carry their own axes, and are in mm. A ``.mrk.json`` that names no coordinate system is in LPS, as its schema
says; a ``.fcsv`` that names none may be either, depending on the version that wrote it, and is refused.
"""

import csv
import io
import json
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.frame import Frame
from warpbrain.problems import Problems
from warpbrain.recordings.tables import position_of
from warpbrain.recordings.text import lines_of, read_text, shown

ENDINGS = (".mrk.json", ".json", ".fcsv")
#: Names of the axes in new files, numbers in old ones.
AXES_NAMED = {"RAS": "RAS", "LPS": "LPS", "0": "RAS", "1": "LPS"}
#: Columns of a `.fcsv` that does not name them.
COLUMNS = "id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID"


@dataclass(frozen=True, eq=False)
class Markup:
    """Control points of a file, or electrodes."""

    points: Floats  # (n, 3) [m, RAS]
    labels: tuple[str, ...]  # may be empty
    #: From other positions (n, 3) [m, RAS] to the text of the file that has them; all else in it stays as it is.
    moved_text: Callable[[Floats], str]


def is_markup(path: Path) -> bool:
    """Whether the ending is that of a Slicer markup."""
    return path.name.lower().endswith(ENDINGS)


def read_markup(path: Path, problems: Problems) -> Markup:
    """Read a markup of one point list, curve or line; `Unreadable` if there are problems."""
    read = _read_fcsv if path.suffix.lower() == ".fcsv" else _read_json
    markup = read(path, read_text(path, problems), problems)
    if not markup.labels:
        problems.refuse(path, "", "found no control points")
    return markup


def paired(start: Markup, end: Markup, path: Path, moved: Path, problems: Problems) -> Floats:
    """Positions (n, 3) in `end` of the points of `start`, paired by label; `Unreadable` if that cannot be done.

    Every label must be there once in both.
    """
    for markup, file in ((start, path), (end, moved)):
        if not all(markup.labels):
            at = markup.labels.index("")
            problems.add(file, f"point {at + 1}", "found no label, expected one: points are paired by label")
        for label, count in sorted(Counter(filter(None, markup.labels)).items()):
            if count > 1:
                problems.add(file, f"label {shown(label)}", f"found it {count} times, expected it once")
    for markup, other, file, partner in ((start, end, path, moved), (end, start, moved, path)):
        for label in sorted(set(markup.labels) - set(other.labels) - {""}):
            problems.add(file, f"label {shown(label)}", f"found no point of this label in {partner.name}")
    problems.require_none()
    row = {label: index for index, label in enumerate(end.labels)}
    return end.points[[row[label] for label in start.labels]]


def _read_json(path: Path, text: str, problems: Problems) -> Markup:
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        problems.refuse(path, "", f"found no valid JSON ({error})", "is the file cut off?")
    markups = content.get("markups") if isinstance(content, dict) else None
    if not isinstance(markups, list):
        problems.refuse(path, "", "found no list 'markups', expected a 3D Slicer markup")
    if len(markups) != 1 or not isinstance(markups[0], dict):
        problems.refuse(path, "markups", f"found {len(markups)} markups, expected one", "save each in its own file")
    markup = markups[0]
    axes = _axes(markup.get("coordinateSystem", "LPS"), path, "coordinateSystem", problems)
    unit = markup.get("coordinateUnits", "mm")
    code = unit[0] if isinstance(unit, list) and unit else unit
    if code != "mm":
        problems.add(path, "coordinateUnits", f"found {shown(code)}, expected 'mm'")
    controls = markup.get("controlPoints", [])
    if not isinstance(controls, list) or not all(isinstance(control, dict) for control in controls):
        problems.refuse(path, "controlPoints", "expected a list of control points")
    positions = [_position(control, number, path, problems) for number, control in enumerate(controls, 1)]
    problems.require_none()
    frame, labels = Frame("mm", axes), tuple(str(control.get("label", "")).strip() for control in controls)

    def moved_text(points: Floats) -> str:
        for control, position in zip(controls, frame.file_lengths(points), strict=True):
            control["position"] = position.tolist()
        return json.dumps(content, indent=4, ensure_ascii=False) + "\n"

    return Markup(frame.lengths(np.array(positions).reshape(-1, 3)), labels, moved_text)


def _position(control: dict[str, Any], number: int, path: Path, problems: Problems) -> list[float]:
    """Where a control point is; nothing, and a problem noted, if that is no place."""
    label = control.get("label")
    place = f"control point {number}" + (f" {shown(label)}" if label else "")
    status = control.get("positionStatus", "defined")
    if status != "defined":
        cure = "place the point in Slicer, or delete it"
        problems.add(path, place, f"found its position {shown(status)}, expected 'defined'", cure)
        return []
    position = control.get("position")
    if isinstance(position, list) and len(position) == 3:
        # true is an integer for Python, and integers of JSON may be larger than any float
        numbers = [float(value) for value in position if type(value) in (int, float) and abs(value) < 1e300]
        if len(numbers) == 3:
            return numbers
    problems.add(path, place, f"found position {shown(position)}, expected three finite numbers")
    return []


def _read_fcsv(path: Path, text: str, problems: Problems) -> Markup:
    axes, named = "", False
    columns = COLUMNS.split(",")
    # of each point the line, its fields, which of them are its position and its label, and the position
    controls: list[tuple[int, list[str], list[int], list[float]]] = []
    lines = lines_of(text)
    for row, line in enumerate(lines, 1):
        if line.startswith("#"):
            key, _, value = line.lstrip("# ").partition("=")
            if key.strip() == "CoordinateSystem":
                named = True
                axes = _axes(value.strip().strip(","), path, f"row {row}", problems)
            elif key.strip() == "columns":
                columns = [name.strip() for name in value.split(",")]
                if not {"x", "y", "z", "label"} <= set(columns):
                    problems.refuse(path, f"row {row}", f"found columns {shown(value)}, expected {COLUMNS}")
        elif line.strip():
            try:
                fields = next(csv.reader([line]))
            except csv.Error as error:
                problems.add(path, f"row {row}", f"found no fields ({error})")
                continue
            where = [columns.index(name) for name in ("x", "y", "z", "label")]
            # rows need not have the columns after the label
            if len(fields) <= max(where):
                problems.add(path, f"row {row}", f"found {len(fields)} fields, expected {len(columns)}")
                continue
            words = [fields[column].strip() for column in where[:3]]
            if (position := position_of(words)) is None:
                problems.add(path, f"row {row}", f"found position {shown(','.join(words))}, expected finite numbers")
            else:
                controls.append((row - 1, fields, where, position))
    if not named:
        cure = "write '# CoordinateSystem = RAS' or LPS as its second line, or save it as .mrk.json"
        problems.add(path, "header", "found no coordinate system", cure)
    problems.require_none()
    frame = Frame("mm", axes)

    def moved_text(points: Floats) -> str:
        moved = list(lines)
        for (at, fields, where, _), position in zip(controls, frame.file_lengths(points), strict=True):
            written = dict(zip(where[:3], (f"{value:.6f}" for value in position), strict=True))
            line = io.StringIO()
            csv.writer(line, lineterminator="").writerow([written.get(k, field) for k, field in enumerate(fields)])
            moved[at] = line.getvalue()
        return "\n".join(moved)

    positions = np.array([position for *_, position in controls]).reshape(-1, 3)
    labels = tuple(fields[where[3]].strip() for _, fields, where, _ in controls)
    return Markup(frame.lengths(positions), labels, moved_text)


def _axes(value: object, path: Path, place: str, problems: Problems) -> str:
    axes = AXES_NAMED.get(str(value).strip(), "")
    if not axes:
        problems.add(path, place, f"found coordinate system {shown(value)}, expected RAS, LPS, 0 (RAS) or 1 (LPS)")
    return axes
