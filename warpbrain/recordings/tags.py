"""MNI ``.tag`` files: pairs of landmarks in the world coordinates of two volumes, which are mm in RAS.

The grammar is that of the MINC Tag file format reference: the line ``MNI Tag Point File``, ``Volumes = 1;`` or ``2;``,
then ``Points =``, one record a line, and a semicolon. A record is x, y and z in each volume, then nothing, or a label,
or weight, structure, patient and label. ``%`` and ``#`` start comments. The weight is not taken over: programs write
0 or 1 there whatever the landmark is worth.
"""

from __future__ import annotations

import csv
from contextlib import suppress
from pathlib import Path

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.problems import Problems, Unreadable
from warpbrain.recordings.tables import LARGEST
from warpbrain.recordings.text import lines_of, read_text, shown, without_comment

TITLE = "MNI Tag Point File"


def read_tags(path: Path, problems: Problems) -> tuple[Floats, Floats, tuple[str, ...] | None]:
    """Start (n, 3) and end (n, 3) of landmarks [mm, RAS] and their labels; `Unreadable` if there are problems.

    Labels are None unless all landmarks have one and no two the same.
    """
    lines = lines_of(read_text(path, problems))
    if lines[0].strip() != TITLE:
        problems.refuse(path, "row 1", f"found {shown(lines[0].strip())}, expected '{TITLE}'")
    state = "Volumes"
    numbers: list[list[float]] = []
    labels: list[str] = []
    for row, line in enumerate(lines[1:], 2):
        if problems.enough:
            break
        content = without_comment(line, "#%").strip()
        if state == "Volumes" and content:
            key, _, value = content.partition("=")
            if key.strip() != "Volumes" or value.strip() != "2;":
                cure = "landmarks before and after are needed: both volumes of a pair in one file"
                problems.refuse(path, f"row {row}", f"found {shown(content)}, expected 'Volumes = 2;'", cure)
            state = "Points"
        elif state == "Points" and content:
            key, equals, content = content.partition("=")
            if key.strip() != "Points" or not equals:
                problems.refuse(path, f"row {row}", f"found {shown(key.strip())}, expected 'Points ='")
            state = "records"
        if state == "records":
            record = without_comment(content, ";")
            if record.strip():
                with suppress(Unreadable):
                    values, label = _record_of(path, row, record, problems)
                    numbers.append(values)
                    labels.append(label)
            if len(record) < len(content):
                state = "end"
                if content[len(record) + 1 :].strip():
                    problems.add(path, f"row {row}", "found text after the semicolon that ends the points")
        elif state == "end" and content:
            problems.add(path, f"row {row}", f"found {shown(content)} after the semicolon that ends the points")
            break
    if state != "end":
        problems.add(path, "", "found no semicolon after the points", "is the file cut off?")
    elif not numbers and not problems:
        problems.add(path, "", "found no points")
    problems.require_none()
    pairs = np.array(numbers)
    named = all(labels) and len(set(labels)) == len(labels)
    return pairs[:, :3], pairs[:, 3:], tuple(labels) if named else None


def _record_of(path: Path, row: int, record: str, problems: Problems) -> tuple[list[float], str]:
    """The six coordinates of a landmark and its label, which may be empty."""
    place = f"row {row}"
    try:
        words = next(csv.reader([" ".join(record.split())], delimiter=" ", strict=True))
    except csv.Error:
        problems.refuse(path, place, "found a quotation mark that is not closed")
    if len(words) not in (6, 7, 10):
        expected = "6 coordinates and no more, or a label, or weight, structure, patient and label"
        problems.refuse(path, place, f"found {len(words)} fields, expected {expected}")
    try:
        values = [float(word) for word in words[:6]]
    except ValueError:
        problems.refuse(path, place, f"found {shown(' '.join(words[:6]))}, expected 6 numbers")
    if not all(abs(value) <= LARGEST for value in values):
        problems.refuse(path, place, f"found {shown(' '.join(words[:6]))}, expected finite numbers")
    return values, words[-1].strip() if len(words) > 6 else ""
