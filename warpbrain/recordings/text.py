"""Files of a case that are text, opened with care: what is no readable text is a problem, and not an exception."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from warpbrain.problems import Problems, Unreadable

#: Largest text file that is read [bytes].
LIMIT = 64 * 2**20
#: Problems of one file that are listed one by one, and that are counted before its reading stops.
LISTED, COUNTED = 20, 2000


@contextmanager
def collected(path: Path, problems: Problems) -> Iterator[Problems]:
    """Problems of one file: in the end the first `LISTED` and the number of the others go to `problems`.

    The block ends where nothing more can be read (`Unreadable`); then there are problems.
    """
    of_file = Problems(COUNTED)
    with suppress(Unreadable):
        yield of_file
    problems.found.extend(of_file.found[:LISTED])
    problems.remarks.extend(of_file.remarks)
    others = len(of_file.found) - LISTED
    if of_file.enough:
        problems.add(path, "", f"and more than {others} more problems in this file, whose reading stopped there")
    elif others > 0:
        problems.add(path, "", f"and {others} more problem{'s' if others > 1 else ''} in this file")


def shown(text: object) -> str:
    """What was found, in quotation marks and short enough for a message."""
    words = str(text)
    return f"'{words[:30]}...'" if len(words) > 33 else f"'{words}'"


def require_readable(path: Path, problems: Problems) -> None:
    """Refuse a file that is not there, empty, or may not be read."""
    try:
        if path.is_dir():
            problems.refuse(path, "", "found a folder, expected a file")
        if not path.exists():
            problems.refuse(path, "", "no such file", _nearest_name(path))
        if not os.access(path, os.R_OK):
            problems.refuse(path, "", "cannot be read", "check its permissions")
        if path.stat().st_size == 0:
            problems.refuse(path, "", "is empty (0 bytes)")
    except OSError as error:
        problems.refuse(path, "", f"cannot be read: {error.strerror}")


def read_text(path: Path, problems: Problems) -> str:
    """The text of a UTF-8 file, with or without byte order mark.

    `problems`: gets what is wrong: no such file, a folder, no permission, nothing in it, larger than `LIMIT`, not
    UTF-8. `Unreadable` if there was a problem.
    """
    require_readable(path, problems)
    try:
        size = path.stat().st_size
        if size > LIMIT:
            problems.refuse(path, "", f"is {size / 2**20:.0f} MB, expected no more than {LIMIT // 2**20} MB of text")
        data = path.read_bytes()
    except OSError as error:
        problems.refuse(path, "", f"cannot be read: {error.strerror}")
    try:
        # some programs put a byte order mark before the one that is there
        text = data.decode("utf-8").lstrip("\ufeff")
    except UnicodeDecodeError as error:
        row = data.count(b"\n", 0, error.start) + 1
        message = f"found byte 0x{data[error.start]:02x} at position {error.start}, expected UTF-8 text"
        problems.refuse(path, f"row {row}", message, "save the file as UTF-8")
    if not text.strip():
        problems.refuse(path, "", "is empty: it holds white space only")
    return text


def remark_open_end(path: Path, text: str, problems: Problems) -> None:
    """Remark on a last row that could be a part of one."""
    if not text.endswith(("\n", "\r")):
        problems.remark(path, "the last row does not end with a line break: is the file cut off?")


def lines_of(text: str) -> list[str]:
    """Lines of a text, whatever ended them on the machine that wrote it."""
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def without_comment(line: str, marks: str = "#") -> str:
    """A line up to the first of `marks` outside double quotation marks."""
    if '"' not in line:
        for mark in marks:
            line = line.partition(mark)[0]
        return line
    inside = False
    for at, character in enumerate(line):
        if character == '"':
            inside = not inside
        elif character in marks and not inside:
            return line[:at]
    return line


def _nearest_name(path: Path) -> str:
    from difflib import get_close_matches

    try:
        names = [entry.name for entry in path.parent.iterdir()]
    except OSError:
        return f"there is no folder {path.parent}"
    near = get_close_matches(path.name, names, n=1)
    return f"is {shown(near[0])} meant?" if near else ""
