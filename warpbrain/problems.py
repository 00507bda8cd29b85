"""Everything that is wrong with a user's files, collected so that all of it can be said at once."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import NoReturn

from warpbrain.errors import InputError

#: What would move the cursor of a terminal otherwise than by lines and tabs, or end the name of a file.
CONTROL = r"[\x00-\x08\x0b-\x1f\x7f-\x9f]"


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong."""

    file: Path
    place: str  # key, table, row or node in the file; empty if it is the file as a whole
    message: str  # what was found and what was expected, on one line
    cure: str = ""  # what to do about it; may be empty where the message says it

    def __str__(self) -> str:
        head = f"{self.file}: {self.place}: " if self.place else f"{self.file}: "
        return head + self.message + (f" ({self.cure})" if self.cure else "")


#: Characters of the place and of the message of a problem, at most: a file can have names of any length.
_PLACE, _MESSAGE = 120, 800


def _shortened(text: str, most: int) -> str:
    # names of keys, too, are a file's
    one_line = re.sub(CONTROL, lambda found: ascii(found[0])[1:-1], " ".join(text.split()))
    return one_line if len(one_line) <= most else f"{one_line[: most - 20]}...{one_line[-20:]}"


def nearest(name: object, names: Iterable[str], otherwise: str | None = None) -> str:
    """The cure for a name that is not known: the one that is probably meant, or `otherwise`, or all of them."""
    known = {candidate.lower(): candidate for candidate in names}
    if near := get_close_matches(str(name).lower(), list(known), n=1):
        return f"did you mean '{known[near[0]]}'?"
    return f"expected one of {', '.join(known.values())}" if otherwise is None else otherwise


class Unreadable(Exception):
    """Nothing is to be had of a file; why is among the problems already."""


class Problems:
    """A list of problems that readers add to and go on reading, up to `most` of them."""

    def __init__(self, most: int | None = None) -> None:
        self._most = most
        self.found: list[Problem] = []
        self.remarks: list[str] = []

    def __bool__(self) -> bool:
        return bool(self.found)

    @property
    def enough(self) -> bool:
        """Whether to look for more problems is worth nobody's time."""
        return self._most is not None and len(self.found) >= self._most

    def add(self, file: Path, place: str, message: str, cure: str = "") -> None:
        """Note a problem; text that came with line breaks is put on one line, and one without an end is given one.

        `Unreadable` once there are `enough`.
        """
        self.found.append(Problem(file, _shortened(place, _PLACE), _shortened(message, _MESSAGE), cure))
        if self.enough:
            raise Unreadable

    def refuse(self, file: Path, place: str, message: str, cure: str = "") -> NoReturn:
        """Note a problem after which nothing more of a file can be read, and raise `Unreadable`."""
        self.add(file, place, message, cure)
        raise Unreadable

    def require_none(self) -> None:
        """Raise `Unreadable` if there is a problem."""
        if self.found:
            raise Unreadable

    def remark(self, file: Path, message: str) -> None:
        """Note what is not wrong and should be known."""
        self.remarks.append(f"{file}: {' '.join(message.split())}")

    def stop(self, folder: Path | None = None) -> None:
        """Raise `InputError` with the first problem, and the number of the others in `folder`, if there is any."""
        if not self.found:
            return
        first, others = self.found[0], len(self.found) - 1
        more = f"; {others} more: `warpbrain cases check {folder or first.file.parent}` lists them" if others else ""
        raise InputError(f"{first}{more}")
