"""Files that are there whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from warpbrain.errors import InputError

#: Temporary files that are being written.
_unfinished: set[Path] = set()


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A temporary path beside `path` to write to; it takes the place of `path` when the block ends without error.

    The temporary file has the same ending, is on the same file system, and is removed if anything goes wrong.

    Raises
    ------
    InputError
        If the folder cannot be written to.
    """
    check_writable(path)
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}-", suffix=path.suffix)
    except OSError as error:
        raise InputError(f"{path.parent}: cannot be written to: {error.strerror}") from None
    os.close(handle)
    temporary = Path(name)
    _unfinished.add(temporary)
    try:
        yield temporary
        # mkstemp makes private files; a result should have the rights that any new file has
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
        _unfinished.discard(temporary)


def check_writable(path: Path) -> None:
    """`InputError` if a file cannot be written there: to know it before long work, not after."""
    if path.is_dir():
        raise InputError(f"{path}: cannot be written: there is a folder of that name")
    if not path.parent.is_dir():
        raise InputError(f"{path.parent}: cannot be written to: no such folder")
    if not os.access(path.parent, os.W_OK | os.X_OK):
        raise InputError(f"{path.parent}: cannot be written to")


def remove_unfinished() -> None:
    """Remove what is half-written, before the process is ended from outside the block that writes it."""
    for temporary in list(_unfinished):
        temporary.unlink(missing_ok=True)


def output_folder(path: Path) -> Path:
    """Make a folder for output if it is not there; `InputError` if it cannot be one."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path}: cannot be made a folder for output: {error.strerror}") from None
    # known now, not only when there is something to write
    if not os.access(path, os.W_OK | os.X_OK):
        raise InputError(f"{path}: cannot be written to")
    return path
