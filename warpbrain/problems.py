"""Everything that is wrong with a user's files, collected so that all of it can be said at once."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from warpbrain.errors import InputError


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong.

    Attributes
    ----------
    file : Path
    place : str
        Key, table, row or node in the file; empty if it is the file as a whole.
    message : str
        What was found and what was expected, on one line.
    cure : str
        What to do about it; may be empty where the message says it.
    """

    file: Path
    place: str
    message: str
    cure: str = ""

    def __str__(self) -> str:
        head = f"{self.file}: {self.place}: " if self.place else f"{self.file}: "
        return head + self.message + (f" ({self.cure})" if self.cure else "")


class Problems:
    """A list of problems that readers add to and go on reading."""

    def __init__(self) -> None:
        self.found: list[Problem] = []
        self.remarks: list[str] = []

    def __bool__(self) -> bool:
        return bool(self.found)

    def add(self, file: Path, place: str, message: str, cure: str = "") -> None:
        """Note a problem; text that came with line breaks is put on one line."""
        one_line = " ".join(message.split())
        self.found.append(Problem(file, place, one_line, cure))

    def remark(self, file: Path, message: str) -> None:
        """Note what is not wrong and should be known."""
        self.remarks.append(f"{file}: {' '.join(message.split())}")

    def stop(self) -> None:
        """Raise `InputError` with the first problem, and the number of the others, if there is any."""
        if not self.found:
            return
        others = len(self.found) - 1
        more = f"; {others} more: `warpbrain cases check {self.found[0].file.parent}` lists them" if others else ""
        raise InputError(f"{self.found[0]}{more}")
