"""Control points of 3D Slicer markups, ``.mrk.json`` and ``.fcsv``: positions and labels, and the file with others.

Both kinds carry their own axes, and are in mm. A ``.mrk.json`` that names no coordinate system is in LPS, as its schema
says; a ``.fcsv`` that names none may be either, depending on the version that wrote it, and is refused.
"""

from __future__ import annotations

import csv
import io
import json
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
    """Control points.

    Attributes
    ----------
    points : (n, 3) array
        [m, RAS]
    labels : tuple of str
        May be empty.
    moved_text : callable
        From other positions (n, 3) [m, RAS] to the text of the file that has them; all else in it stays as it is.
    """

    points: Floats
    labels: tuple[str, ...]
    moved_text: Callable[[Floats], str]


def is_markup(path: Path) -> bool:
    """Whether the ending is that of a Slicer markup."""
    return path.name.lower().endswith(ENDINGS)


def read_markup(path: Path, problems: Problems) -> Markup | None:
    """Read a markup of one point list, curve or line; None if there were problems."""
    text = read_text(path, problems)
    if text is None:
        return None
    before = len(problems.found)
    read = _read_fcsv if path.suffix.lower() == ".fcsv" else _read_json
    markup = read(path, text, problems)
    if markup is not None and not markup.labels and len(problems.found) == before:
        problems.add(path, "", "found no control points")
    return markup if len(problems.found) == before else None


def paired(start: Markup, end: Markup, path: Path, moved: Path, problems: Problems) -> Floats | None:
    """Positions (n, 3) in `end` of the points of `start`, paired by label; None if that cannot be done.

    Every label must be there once in both.
    """
    before = len(problems.found)
    for markup, file in ((start, path), (end, moved)):
        if not all(markup.labels):
            at = markup.labels.index("")
            problems.add(file, f"point {at + 1}", "found no label, expected one: points are paired by label")
        for label in sorted({label for label in markup.labels if label and markup.labels.count(label) > 1}):
            count = markup.labels.count(label)
            problems.add(file, f"label {shown(label)}", f"found it {count} times, expected it once")
    for markup, other, file, partner in ((start, end, path, moved), (end, start, moved, path)):
        for label in sorted(set(markup.labels) - set(other.labels) - {""}):
            problems.add(file, f"label {shown(label)}", f"found no point of this label in {partner.name}")
    if len(problems.found) > before:
        return None
    row = {label: index for index, label in enumerate(end.labels)}
    return end.points[[row[label] for label in start.labels]]


def _read_json(path: Path, text: str, problems: Problems) -> Markup | None:
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        problems.add(path, "", f"found no valid JSON ({error})", "is the file cut off?")
        return None
    markups = content.get("markups") if isinstance(content, dict) else None
    if not isinstance(markups, list):
        problems.add(path, "", "found no list 'markups', expected a 3D Slicer markup")
        return None
    if len(markups) != 1 or not isinstance(markups[0], dict):
        problems.add(path, "markups", f"found {len(markups)} markups, expected one", "save each in its own file")
        return None
    markup = markups[0]
    axes = _axes(markup.get("coordinateSystem", "LPS"), path, "coordinateSystem", problems)
    unit = markup.get("coordinateUnits", "mm")
    code = unit[0] if isinstance(unit, list) and unit else unit
    if code != "mm":
        problems.add(path, "coordinateUnits", f"found {shown(code)}, expected 'mm'")
    controls = markup.get("controlPoints", [])
    if not isinstance(controls, list) or not all(isinstance(control, dict) for control in controls):
        problems.add(path, "controlPoints", "expected a list of control points")
        return None
    positions = [_position(control, number, path, problems) for number, control in enumerate(controls, 1)]
    labels = tuple(str(control.get("label", "")).strip() for control in controls)

    def moved_text(points: Floats) -> str:
        for control, position in zip(controls, Frame("mm", axes or "LPS").file_lengths(points), strict=True):
            control["position"] = position.tolist()
        return json.dumps(content, indent=4, ensure_ascii=False) + "\n"

    return _markup([position for position in positions if position is not None], labels, axes, moved_text)


def _position(control: dict[str, Any], number: int, path: Path, problems: Problems) -> list[float] | None:
    label = control.get("label")
    place = f"control point {number}" + (f" {shown(label)}" if label else "")
    status = control.get("positionStatus", "defined")
    if status != "defined":
        cure = "place the point in Slicer, or delete it"
        problems.add(path, place, f"found its position {shown(status)}, expected 'defined'", cure)
        return None
    position = control.get("position")
    if isinstance(position, list) and len(position) == 3:
        # true is an integer for Python, and integers of JSON may be larger than any float
        numbers = [float(value) for value in position if type(value) in (int, float) and abs(value) < 1e300]
        if len(numbers) == 3:
            return numbers
    problems.add(path, place, f"found position {shown(position)}, expected three finite numbers")
    return None


def _read_fcsv(path: Path, text: str, problems: Problems) -> Markup | None:
    axes: str | None = None
    named = False
    columns = COLUMNS.split(",")
    positions: list[list[float]] = []
    labels: list[str] = []
    # of each point the line, its fields, and which of them are its position
    points_in: list[tuple[int, list[str], list[int]]] = []
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
                    problems.add(path, f"row {row}", f"found columns {shown(value)}, expected {COLUMNS}")
                    return None
        elif line.strip():
            try:
                fields = next(csv.reader([line]))
            except csv.Error as error:
                problems.add(path, f"row {row}", f"found no fields ({error})")
                continue
            # rows need not have the columns after the label
            last = max(columns.index(name) for name in ("x", "y", "z", "label"))
            if len(fields) <= last:
                problems.add(path, f"row {row}", f"found {len(fields)} fields, expected {len(columns)}")
                continue
            where = [columns.index(name) for name in ("x", "y", "z")]
            words = [fields[column].strip() for column in where]
            if (position := position_of(words)) is None:
                problems.add(path, f"row {row}", f"found position {shown(','.join(words))}, expected finite numbers")
                continue
            positions.append(position)
            labels.append(fields[columns.index("label")].strip())
            points_in.append((row - 1, fields, where))
    if not named:
        cure = "write '# CoordinateSystem = RAS' or LPS as its second line, or save it as .mrk.json"
        problems.add(path, "header", "found no coordinate system", cure)

    def moved_text(points: Floats) -> str:
        moved = list(lines)
        for (at, fields, where), position in zip(
            points_in, Frame("mm", axes or "RAS").file_lengths(points), strict=True
        ):
            written = dict(zip(where, (f"{value:.6f}" for value in position), strict=True))
            line = io.StringIO()
            csv.writer(line, lineterminator="").writerow([written.get(k, field) for k, field in enumerate(fields)])
            moved[at] = line.getvalue()
        return "\n".join(moved)

    return _markup(positions, tuple(labels), axes, moved_text)


def _axes(value: object, path: Path, place: str, problems: Problems) -> str | None:
    axes = AXES_NAMED.get(str(value).strip())
    if axes is None:
        problems.add(path, place, f"found coordinate system {shown(value)}, expected RAS, LPS, 0 (RAS) or 1 (LPS)")
    return axes


def _markup(
    positions: list[list[float]], labels: tuple[str, ...], axes: str | None, moved_text: Callable[[Floats], str]
) -> Markup | None:
    if axes is None:
        return None
    return Markup(Frame("mm", axes).lengths(np.array(positions).reshape(-1, 3)), labels, moved_text)
