"""Tables in CSV files: named columns of numbers and words, every wrong row and value of a file reported at once.

A table has one header line. ``#`` starts a comment, on a line of its own or after a row. Columns are in any order, and
columns that nobody asks for may hold anything; a remark names them. Fields are separated by commas, or by semicolons or
tabs if the header has those and no comma.
"""

import csv
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.problems import Problems, Unreadable
from warpbrain.recordings.text import lines_of, read_text, remark_open_end, shown, without_comment

#: No length, time, force or stress that anybody records is larger, in whatever unit; squares of it are still numbers.
LARGEST = 1e12


@dataclass(frozen=True, eq=False)
class Table:
    """A table as it was read: cells that are asked for are checked, and what is wrong is added to `problems`."""

    path: Path
    header: list[str]  # names of the columns
    cells: list[list[str]]  # each as long as the header
    rows: list[int]  # line in the file of each row, counted from 1
    problems: Problems

    def __len__(self) -> int:
        return len(self.rows)

    def __contains__(self, name: str) -> bool:
        return name in self.header

    def problem(self, index: int, name: str, message: str, cure: str = "") -> None:
        """Note a problem with the value of column `name` in a row, counted from 0."""
        self.problems.add(self.path, f"row {self.rows[index]}, column {name}", message, cure)

    def has(self, *names: str) -> bool:
        """Whether all these columns are there; each that is not is a problem."""
        missing = [name for name in names if name not in self.header]
        for name in missing:
            # people add units to names: "x [mm]", "x_mm"
            bare = {re.split(r"[^a-z0-9]", column.lower())[0]: column for column in reversed(self.header) if column}
            plain = bare | {column.lower(): column for column in reversed(self.header) if column}
            near = get_close_matches(name.lower(), list(plain), n=1, cutoff=0.4)
            columns = ", ".join(self.header[:8]) + (", ..." if len(self.header) > 8 else "")
            cure = f"is {shown(plain[near[0]])} meant?" if near else ""
            self.problems.add(self.path, "header", f"found no column '{name}', found {columns[:100]}", cure)
        return not missing

    def require(self, *names: str) -> None:
        """`Unreadable` if one of these columns is not there."""
        if not self.has(*names):
            raise Unreadable

    def words(self, name: str) -> tuple[str, ...]:
        """A column as text, none of it empty."""
        column = self.header.index(name)
        words = tuple(row[column] for row in self.cells)
        for index, word in enumerate(words):
            if not word:
                self.problem(index, name, "found nothing, expected a name")
        return words

    def numbers(self, name: str) -> Floats:
        """A column as finite numbers (n,); NaN where there was a problem."""
        column = self.header.index(name)
        values = np.full(len(self), np.nan)
        for index, row in enumerate(self.cells):
            cell = row[column]
            value = number_in(cell)
            if value is not None and abs(value) <= LARGEST:
                values[index] = value
            elif not cell:
                self.problem(index, name, "found nothing, expected a number", "leave out rows that were not recorded")
            elif value is not None:
                what = f"a number of at most {LARGEST:g}" if math.isfinite(value) else "a finite number"
                self.problem(index, name, f"found {shown(cell)}, expected {what}")
            else:
                comma = number_in(cell.replace(",", ".")) is not None
                cure = "write decimals with a point" if comma else ""
                self.problem(index, name, f"found {shown(cell)}, expected a number", cure)
        return values

    def vectors(self, *names: str) -> Floats:
        """Columns side by side, (n, number of names)."""
        return np.stack([self.numbers(name) for name in names], axis=1)

    def bounded(self, name: str, lowest: float, *, itself: bool) -> Floats:
        """A column of numbers none of which may be less than `lowest`, nor be it unless `itself`."""
        values = self.numbers(name)
        wrong = values < lowest if itself else values <= lowest
        for index in np.flatnonzero(wrong):
            limit = f"{lowest:g} or more" if itself else f"more than {lowest:g}"
            self.problem(int(index), name, f"found {values[index]:g}, expected {limit}")
        return values

    def times(self, *, strictly: bool, of: Sequence[str] | None = None) -> Floats:
        """Column ``t`` [s], which must not decrease down the file, or must increase if `strictly`.

        `of` names what each row is about; then the rule holds for each of these by itself.
        """
        values = self.numbers("t")
        before: dict[str, int] = {}
        for index in np.flatnonzero(np.isfinite(values)).tolist():
            key = of[index] if of is not None else ""
            if key in before:
                last = before[key]
                if values[index] < values[last] or (strictly and values[index] == values[last]):
                    whose = f" of {shown(key)}" if of is not None else ""
                    rule = "a later time" if strictly else "no earlier time"
                    message = f"found {values[index]:.12g} s after {values[last]:.12g} s (row {self.rows[last]}){whose}"
                    self.problem(index, "t", f"{message}, expected {rule}")
            before[key] = index
        return values


def read_table(path: Path, problems: Problems, known: Sequence[str]) -> Table:
    """Read a CSV file.

    `problems`: gets everything that is wrong; rows that are too long or too short are left out of the table. `known`:
    columns that mean something: none of them may be there twice. `Unreadable` if there is no table to speak of: no
    readable text, no header or no rows.
    """
    text = read_text(path, problems)
    remark_open_end(path, text, problems)
    header: list[str] = []
    separator = ","
    cells: list[list[str]] = []
    rows: list[int] = []
    broken = 0
    for number, line in enumerate(lines_of(text), 1):
        content = without_comment(line)
        if not content.strip():
            continue
        if not header:
            separator = next((mark for mark in ",;\t" if mark in content), ",")
        try:
            quoted = csv.reader([content], delimiter=separator, strict=True, skipinitialspace=True)
            words = next(quoted) if '"' in content else content.split(separator)
        except csv.Error:
            problems.add(path, f"row {number}", "found a quotation mark that is not closed, or one inside a field")
            broken += 1
            continue
        fields = [word.strip() for word in words]
        if not header:
            header = fields
            _check_header(path, number, header, known, problems)
        elif not any(fields):
            continue  # what spreadsheets write for an empty line
        elif len(fields) != len(header):
            message = (
                f"found {len(fields)} field{'s' if len(fields) != 1 else ''}, expected {len(header)} as in the header"
            )
            problems.add(path, f"row {number}", message, "is the file cut off?" if len(fields) < len(header) else "")
            broken += 1
        else:
            cells.append(fields)
            rows.append(number)
    if not rows and not broken:
        problems.refuse(path, "", "found a header and no rows" if header else "found comments only, expected a header")
    if not rows:
        raise Unreadable
    return Table(path, header, cells, rows, problems)


def _check_header(path: Path, number: int, header: list[str], known: Sequence[str], problems: Problems) -> None:
    if all(number_in(name) is not None for name in header):
        cure = "the line with the names must not start with #"
        problems.refuse(path, f"row {number}", f"found numbers, expected a header such as {','.join(known[:6])}", cure)
    for name in known:
        if header.count(name) > 1:
            problems.add(path, "header", f"found column '{name}' {header.count(name)} times, expected it once")
    others = [name for name in header if name and name not in known]
    if others:
        problems.remark(path, f"ignores column{'s' if len(others) > 1 else ''} {', '.join(others)[:150]}")


def read_csv(path: Path, problems: Problems, known: Sequence[str]) -> Table:
    """The same of a file that must be called ``.csv``."""
    if path.suffix.lower() != ".csv":
        problems.refuse(path, "", f"found ending {shown(path.suffix)}, expected .csv")
    return read_table(path, problems, known)


def number_in(cell: str) -> float | None:
    """The number of a cell, None if it is none."""
    # Python reads 1_000 as a thousand; in a file it is more likely a name
    if "_" in cell:
        return None
    try:
        return float(cell)
    except ValueError:
        return None


def position_of(words: Sequence[str]) -> list[float] | None:
    """Coordinates, None if they are no finite numbers."""
    values = [value for word in words if (value := number_in(word)) is not None]
    return values if len(values) == len(words) and all(abs(value) <= LARGEST for value in values) else None
