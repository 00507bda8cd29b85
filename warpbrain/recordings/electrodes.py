"""Electrodes as BIDS has them: ``*_electrodes.tsv``, and ``*_coordsystem.json`` beside it, which says unit and axes.

https://bids-specification.readthedocs.io/en/stable/modality-specific-files/intracranial-electroencephalography.html
"""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.problems import Problems
from warpbrain.recordings.markups import Markup
from warpbrain.recordings.tables import position_of
from warpbrain.recordings.text import lines_of, read_text, shown

ENDING = "electrodes.tsv"
#: Metres of the units of the specification.
_METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
#: Coordinate systems of the head or of a screen and not the scanner's: nothing says where they are in an image.
_ELSEWHERE = ("pixels", "ctf", "elektaneuromag", "4dbti", "kityokogawa", "chietiitab", "captrak", "eeglab", "eeglab-hj")
_NOTHING = "n/a"


def is_electrodes(path: Path) -> bool:
    """Whether the name is that of a BIDS file of electrodes."""
    return path.name.lower().endswith(ENDING)


def read_electrodes(path: Path, problems: Problems) -> Markup:
    """Read the electrodes that have a position; `Unreadable` if there are problems.

    Positions are taken for scanner coordinates (RAS), as `iEEGCoordinateSystem` ACPC, ScanRAS, a template's or Other
    are; without a ``coordsystem.json`` they are in mm, which is remarked.
    """
    header, *cells = [line.split("\t") for line in lines_of(read_text(path, problems)) if line.strip()]
    for name in ("name", "x", "y", "z"):
        if name not in header:
            problems.add(path, "header", f"found no column '{name}', found {', '.join(header)[:100]}")
    problems.require_none()
    names, points, rows = [], [], []
    for number, row in enumerate(cells):
        if len(row) != len(header):
            problems.add(path, f"row {number + 2}", f"found {len(row)} fields, expected {len(header)}")
            continue
        words = [row[header.index(axis)].strip() for axis in "xyz"]
        if all(word.lower() == _NOTHING for word in words):
            continue
        if (values := position_of(words)) is None:
            problems.add(path, f"row {number + 2}", f"found position {shown(' '.join(words))}, expected finite numbers")
            continue
        names.append(row[header.index("name")].strip())
        points.append(values)
        rows.append(number)
    if not points and not problems:
        problems.add(path, "", "found no electrode with a position")
    metres = _unit(path, problems)
    problems.require_none()

    def moved_text(moved: Floats) -> str:
        table = [list(row) for row in cells]
        for row, position in zip(rows, moved / metres, strict=True):
            for name, value in zip("xyz", position, strict=True):
                table[row][header.index(name)] = f"{value:.9g}"
        return "".join("\t".join(row) + "\n" for row in (header, *table))

    return Markup(metres * np.array(points), tuple(names), moved_text)


def _unit(path: Path, problems: Problems) -> float:
    """Metres of one unit of a file; that its coordinate system cannot be used is a problem."""

    def entities(file: Path) -> set[str]:
        return set(re.sub(r"(electrodes\.tsv|coordsystem\.json)$", "", file.name.lower()).split("_")) - {""}

    # the file with most of the entities of the file of electrodes, and no other
    sides = [side for side in path.parent.glob("*coordsystem.json") if entities(side) <= entities(path)]
    side = max(sides, key=lambda side: (len(entities(side)), side), default=None)
    if side is None:
        problems.remark(path, "no coordsystem.json beside it: positions are taken for mm in scanner coordinates (RAS)")
        return _METRES["mm"]
    try:
        content: Any = json.loads(side.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError) as error:
        problems.refuse(side, "", f"found no valid JSON ({error})")
    if not isinstance(content, dict):
        problems.refuse(side, "", "found no object, expected that of a BIDS coordsystem.json")
    kind = next((kind for kind in ("iEEG", "EEG", "MEG", "NIRS") if f"{kind}CoordinateSystem" in content), "iEEG")
    system, unit = (content.get(f"{kind}Coordinate{what}") for what in ("System", "Units"))
    if str(system).lower() in _ELSEWHERE:
        cure = "give positions in scanner coordinates (ScanRAS or ACPC) of the image"
        problems.add(side, f"{kind}CoordinateSystem", f"found {shown(system)}, expected one of an image", cure)
    if not isinstance(unit, str) or unit not in _METRES:
        problems.refuse(side, f"{kind}CoordinateUnits", f"found {shown(unit)}, expected one of {', '.join(_METRES)}")
    return _METRES[unit]
