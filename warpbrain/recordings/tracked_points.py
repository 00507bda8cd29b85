"""Files with tracked points: a reader for each ending, those of other packages among them."""

import csv
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path

import numpy as np

from warpbrain.frame import Frame
from warpbrain.plugins import added_by_packages
from warpbrain.problems import Problems, Unreadable
from warpbrain.recordings.base import DISPLACEMENT, POSITION, TrackedPoints
from warpbrain.recordings.markups import is_markup, paired, read_markup
from warpbrain.recordings.tables import LARGEST, number_in, read_table
from warpbrain.recordings.text import collected, lines_of, read_text, require_readable, shown, without_comment

#: Reads a file of the ending that it is registered for (entry points of the group `warpbrain.recordings`, named like
#: ``".trc"``). It raises `ValueError`, or an error that derives from it, with what is wrong; the file is named for it.
Reader = Callable[[Path], TrackedPoints]


@cache
def added_readers() -> dict[str, Reader]:
    """Readers of other packages, by ending in small letters."""
    return added_by_packages("recordings", dict.fromkeys((".csv", ".tag", ".json", ".fcsv")))


def tracked_points(path: Path, frame: Frame, moved: Path | None, problems: Problems) -> TrackedPoints:
    """Points of a file.

    `frame`: unit and axes of a CSV file; all others state theirs.
    `moved`: the second markup of a pair.
    `problems`: gets what is wrong.

    `Unreadable` if there is nothing to be had of the file.
    """
    ending = path.suffix.lower()
    if is_markup(path):
        return _of_markups(path, moved, problems)
    if ending not in (".csv", ".tag", *added_readers()):
        others = "".join(f"{name}, " for name in added_readers())
        problems.refuse(path, "", f"found ending {shown(ending)}, expected .csv, .tag, {others}.mrk.json or .fcsv")
    if moved is not None:
        problems.refuse(path, "moved", f"a {ending} file holds where points went; 'moved' goes with 3D Slicer markups")
    if ending == ".csv":
        return _of_csv(path, frame, problems)
    if ending == ".tag":
        return _of_tags(path, problems)
    require_readable(path, problems)
    try:
        tracked = added_readers()[ending](path)
    except (ValueError, OSError) as error:
        problems.refuse(path, "", str(error))
    if fault := _fault(tracked):
        problems.refuse(path, "", fault)
    return tracked


def _fault(tracked: TrackedPoints) -> str:
    """What is wrong with points that another package has read; empty if nothing is."""
    n, ids = len(tracked.points), tracked.ids
    if not n:
        return "found no points"
    shapes = {"points": (n, 3), "displacement": (n, 3), "time": (n,), "sigmas": (n,), "weights": (n,)}
    for name, shape in shapes.items():
        values = getattr(tracked, name)
        if values is not None and (np.shape(values) != shape or not np.isfinite(values).all()):
            return f"{name}: expected finite numbers of shape {shape}, found {np.shape(values)}"
    if ids is not None and len(ids) != n:
        return f"ids: expected one for each of {n} points, found {len(ids)}"
    if ids is not None and tracked.time is None and len(set(ids)) < n:
        return "found an id twice, expected each once where there is no time"
    return ""


def _of_csv(path: Path, frame: Frame, problems: Problems) -> TrackedPoints:
    table = read_table(path, problems, (*POSITION, *DISPLACEMENT, "t", "id", "sigma", "weight"))
    table.require(*POSITION, *DISPLACEMENT)
    ids = table.words("id") if "id" in table else None
    first: dict[str, int] = {}
    for index, name in enumerate(ids if ids is not None and "t" not in table else ()):
        if name in first:
            message = f"found {shown(name)} again (row {table.rows[first[name]]})"
            table.problem(index, "id", f"{message}, expected each id once where there is no time t")
        elif name:
            first[name] = index
    return TrackedPoints(
        points=frame.lengths(table.vectors(*POSITION)),
        displacement=frame.lengths(table.vectors(*DISPLACEMENT)),
        time=table.times(strictly=ids is not None, of=ids) if "t" in table else None,
        ids=ids,
        sigmas=frame.metres * table.bounded("sigma", 0.0, itself=False) if "sigma" in table else None,
        weights=table.bounded("weight", 0.0, itself=True) if "weight" in table else None,
    )


def _of_markups(path: Path, moved: Path | None, problems: Problems) -> TrackedPoints:
    if moved is None:
        cure = "name a second markup with the same labels as 'moved'"
        problems.refuse(path, "moved", "a 3D Slicer markup holds where points are, not where they went", cure)
    if not is_markup(moved):
        problems.refuse(moved, "", f"found ending {shown(moved.suffix)}, expected a 3D Slicer markup as {path.name} is")
    # what is wrong with either is told
    with collected(path, problems) as wrong:
        start = read_markup(path, wrong)
    with collected(moved, problems) as wrong:
        end = read_markup(moved, wrong)
    problems.require_none()
    positions = paired(start, end, path, moved, problems)
    return TrackedPoints(points=start.points, displacement=positions - start.points, ids=start.labels)


TITLE = "MNI Tag Point File"


def _of_tags(path: Path, problems: Problems) -> TrackedPoints:
    """Pairs of landmarks in the world coordinates of two volumes, which are mm in RAS.

    The grammar is that of the MINC Tag file format reference: the line `TITLE`, ``Volumes = 1;`` or ``2;``, then
    ``Points =``, one record a line, and a semicolon. A record is x, y and z in each volume, then nothing, or a label,
    or weight, structure, patient and label. ``%`` and ``#`` start comments. The weight is not taken over: programs
    write 0 or 1 there whatever the landmark is worth. Nor are labels, unless all landmarks have one and no two the
    same.
    """
    lines = lines_of(read_text(path, problems))
    if lines[0].strip() != TITLE:
        problems.refuse(path, "row 1", f"found {shown(lines[0].strip())}, expected '{TITLE}'")
    rows = [(row, without_comment(line, "#%").strip()) for row, line in enumerate(lines[1:], 2)]
    rows = [(row, content) for row, content in rows if content]
    if rows:
        row, content = rows[0]
        key, _, value = content.partition("=")
        if key.strip() != "Volumes" or value.strip() != "2;":
            cure = "landmarks before and after are needed: both volumes of a pair in one file"
            problems.refuse(path, f"row {row}", f"found {shown(content)}, expected 'Volumes = 2;'", cure)
    if len(rows) > 1:
        row, content = rows[1]
        key, equals, first = content.partition("=")
        if key.strip() != "Points" or not equals:
            problems.refuse(path, f"row {row}", f"found {shown(key.strip())}, expected 'Points ='")
        rows[1] = row, first
    records: list[tuple[list[float], str]] = []
    ended = False
    for row, content in rows[1:]:
        if ended:
            problems.add(path, f"row {row}", f"found {shown(content)} after the semicolon that ends the points")
        if ended or problems.enough:
            break
        record = without_comment(content, ";")
        if record.strip():
            with suppress(Unreadable):
                records.append(_record_of(path, row, record, problems))
        ended = len(record) < len(content)
        if content[len(record) + 1 :].strip():
            problems.add(path, f"row {row}", "found text after the semicolon that ends the points")
    if not ended:
        problems.add(path, "", "found no semicolon after the points", "is the file cut off?")
    elif not records and not problems:
        problems.add(path, "", "found no points")
    problems.require_none()
    labels = [label for _, label in records]
    start, end = np.split(np.array([values for values, _ in records]), 2, axis=1)
    frame = Frame("mm", "RAS")
    ids = tuple(labels) if all(labels) and len(set(labels)) == len(labels) else None
    return TrackedPoints(points=frame.lengths(start), displacement=frame.lengths(end - start), ids=ids)


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
    values = [value for word in words[:6] if (value := number_in(word)) is not None]
    if len(values) < 6:
        problems.refuse(path, place, f"found {shown(' '.join(words[:6]))}, expected 6 numbers")
    if not all(abs(value) <= LARGEST for value in values):
        problems.refuse(path, place, f"found {shown(' '.join(words[:6]))}, expected finite numbers")
    return values, words[-1].strip() if len(words) > 6 else ""
