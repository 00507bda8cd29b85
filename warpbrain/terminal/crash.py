"""A crash tells: a report with what a developer needs and nothing of a user's data."""

from __future__ import annotations

import os
import platform
import shlex
import tempfile
import traceback
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from warpbrain import __version__

#: Exit status of a defect: EX_SOFTWARE of `sysexits.h`.
SOFTWARE = 70
#: Characters of a line of a report: a message of an exception may hold what an array holds.
_WIDTH = 200
_PACKAGES = ("warp-lang", "numpy", "scipy", "meshio", "h5py", "matplotlib", "nibabel", "SimpleITK", "mmgpy", "cupy")


def write_report(error: BaseException, arguments: Sequence[str], doing: str) -> Path | None:
    """Write what happened to the working folder, or where it cannot be written to that for temporary files; None if it
    can be written nowhere. `doing` is what was said last of what is done."""
    text = report_of(error, arguments, doing)
    name = f"warpbrain-crash-{datetime.now(UTC):%Y%m%d-%H%M%S}-{os.getpid()}.txt"
    for folder in (Path.cwd, lambda: Path(tempfile.gettempdir())):
        try:
            path = folder() / name
            path.write_text(text, encoding="utf-8", errors="replace")
        except OSError:
            continue
        return path
    return None


def report_of(error: BaseException, arguments: Sequence[str], doing: str) -> str:
    """Versions, arguments and traceback; no values of variables, and no line that is long."""
    versions = {"warpbrain": __version__, "python": platform.python_version(), "platform": platform.platform()}
    for name in _PACKAGES:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            continue
    lines = [
        "A defect of warpbrain. Please send this file to its developers; look through it first: it holds the command",
        "with its file names, versions and where the program was, and no data.",
        "",
        f"command    {shlex.join(['warpbrain', *arguments])}",
        f"doing      {doing or 'not said'}",
        f"when       {datetime.now(UTC).isoformat(timespec='seconds')}",
        *(f"{name:<10} {text}" for name, text in versions.items()),
        "",
        *"".join(traceback.format_exception(error)).splitlines(),
    ]
    return "\n".join(line if len(line) <= _WIDTH else f"{line[:_WIDTH]}..." for line in lines) + "\n"


def where(error: BaseException) -> str:
    """The file and line of ours that the exception came through last."""
    places = [
        frame for frame in traceback.extract_tb(error.__traceback__) if "warpbrain" in Path(frame.filename).parts[:-1]
    ]
    if not places:
        return "outside of warpbrain"
    last = places[-1]
    parts = Path(last.filename).parts
    return f"{'/'.join(parts[len(parts) - parts[::-1].index('warpbrain') :])}, line {last.lineno}"
