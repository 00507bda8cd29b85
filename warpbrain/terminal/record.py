"""What a command says, on standard output and in a log file beside its results."""

import shlex
import time
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from warpbrain.atomic import write_text

#: Name of the log in a folder of results.
LOG = "warpbrain.log"


class Record:
    """Prints lines, unless it is quiet, and keeps them with the arguments of the command line."""

    def __init__(self, arguments: Sequence[str] = (), quiet: bool = False) -> None:
        self.arguments = tuple(arguments)
        self._quiet = quiet
        self._begun = datetime.now(UTC)
        #: When the command began, as `time.perf_counter` counts.
        self.clock = time.perf_counter()
        self._facts: dict[str, str] = {}
        self._lines: list[str] = []
        self._warnings: list[str] = []
        #: Names of the files that were written.
        self.files: list[str] = []

    def say(self, *lines: str) -> None:
        """Print lines, if there are any."""
        self._lines += lines
        if lines and not self._quiet:
            print(*lines, sep="\n")

    @property
    def doing(self) -> str:
        """The last line that was said."""
        return "\n".join(self._lines).rstrip().rpartition("\n")[2].strip()[:80]

    def note(self, **facts: str) -> None:
        """What the log should say and nobody needs to read: device, versions, files."""
        self._facts |= facts

    @contextmanager
    def warnings_kept(self) -> Iterator[None]:
        """Python's warnings in the block stand in the log, too, and are shown as ever."""
        with warnings.catch_warnings():
            shown = warnings.showwarning

            def keep(
                message: Warning | str, category: type[Warning], filename: str, lineno: int, *rest: Any, **named: Any
            ) -> None:
                self._warnings.append(f"{category.__name__}: {' '.join(str(message).split())}")
                shown(message, category, filename, lineno, *rest, **named)

            warnings.showwarning = keep
            yield

    def write(self, folder: Path, ending: str, replace: bool = True) -> None:
        """Write the log, whole, in the place of the one that is there or after it; `ending` is "done", or why the
        command ended before it was."""
        head = {
            "command": shlex.join(["warpbrain", *self.arguments]),
            "in": str(Path.cwd()),
            "begun": self._begun.isoformat(timespec="seconds"),
            **self._facts,
            "took": f"{time.perf_counter() - self.clock:.1f} s",
            "ended": " ".join(ending.split()),
        }
        lines = [f"{name:<10}{text}" for name, text in head.items()]
        lines += [f"{'file':<10}{name}" for name in self.files]
        lines += [f"{'warning':<10}{text}" for text in dict.fromkeys(self._warnings)]
        # what was printed is indented: no title of a case is taken for a line of the head
        printed = [f"    {line}".rstrip() for line in "\n".join(self._lines).splitlines()]
        before = "" if replace else _text_of(folder)
        write_text(folder / LOG, before + "\n".join([*lines, "", *printed]) + "\n\n")


def files_of(folder: Path) -> list[str]:
    """Names of the files that the log of a folder says were written; none without a log."""
    return [line[10:] for line in _text_of(folder).splitlines() if line[:10].rstrip() == "file"]


def _text_of(folder: Path) -> str:
    try:
        return (folder / LOG).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return ""
