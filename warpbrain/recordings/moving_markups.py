"""3D Slicer markups with their control points elsewhere: all else in the file stays as it is."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from warpbrain.arrays import Floats
from warpbrain.frame import Frame
from warpbrain.recordings.markups import AXES_NAMED, COLUMNS
from warpbrain.recordings.text import lines_of


def moved_markup(path: Path, text: str, points: ArrayLike) -> str:
    """The text of a markup that `read_markup` read, with other positions.

    Parameters
    ----------
    path : Path
        Its ending says which kind it is.
    text : str
    points : (n, 3) array
        Of all control points, in their order [m, RAS]; they are written in the unit and axes of the file.
    """
    positions = np.asarray(points, dtype=np.float64)
    return _fcsv(text, positions) if path.suffix.lower() == ".fcsv" else _json(text, positions)


def _json(text: str, points: Floats) -> str:
    content = json.loads(text)
    markup = content["markups"][0]
    frame = Frame("mm", AXES_NAMED[str(markup.get("coordinateSystem", "LPS")).strip()])
    for control, position in zip(markup.get("controlPoints", []), frame.file_lengths(points), strict=True):
        control["position"] = [float(value) for value in position]
    return json.dumps(content, indent=4, ensure_ascii=False) + "\n"


def _fcsv(text: str, points: Floats) -> str:
    frame, columns = Frame("mm", "RAS"), COLUMNS.split(",")
    left = iter(points)
    lines = []
    for line in lines_of(text):
        if line.startswith("#"):
            key, _, value = line.lstrip("# ").partition("=")
            if key.strip() == "CoordinateSystem":
                frame = Frame("mm", AXES_NAMED[value.strip().strip(",")])
            elif key.strip() == "columns":
                columns = [name.strip() for name in value.split(",")]
        elif line.strip():
            fields = next(csv.reader([line]))
            for name, value in zip("xyz", frame.file_lengths(next(left)), strict=True):
                fields[columns.index(name)] = f"{value:.6f}"
            row = io.StringIO()
            csv.writer(row, lineterminator="").writerow(fields)
            line = row.getvalue()
        lines.append(line)
    return "\n".join(lines)
