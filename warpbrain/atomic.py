"""Files that are there whole or not at all, after a power failure too: what has its name is on the disk."""

import csv
import errno
import os
import re
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from warpbrain.errors import InputError

#: Temporary files and folders that are being written.
_unfinished: set[Path] = set()
#: How their names begin: what a process that was killed leaves is known by it.
UNFINISHED = ".unfinished-"
#: The disk, or what one may have of it, is full.
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def is_full(error: OSError) -> bool:
    """Whether there is no place left to write to: no fault of the input."""
    return error.errno in _FULL


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A temporary path beside `path` to write to; it takes the place of `path` when the block ends without error.

    The temporary file has the same ending, is on the same file system, and is removed if anything goes wrong.
    `InputError` if the folder cannot be written to.
    """
    check_writable(path)
    with _input_errors(path.parent, "cannot be written to"):
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f"{UNFINISHED}{path.stem}-", suffix=path.suffix)
    os.close(handle)
    temporary = Path(name)
    _unfinished.add(temporary)
    try:
        yield temporary
        _to_disk(temporary)
        _make_public(temporary, 0o666)
        temporary.replace(path)
        _entries_to_disk(path.parent)
    finally:
        temporary.unlink(missing_ok=True)
        _unfinished.discard(temporary)


def write_text(path: Path, text: str) -> None:
    """Write a text as UTF-8, whole; see `whole_file`."""
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_csv(path: Path, rows: Iterable[Iterable[Any]], lineterminator: str = "\r\n") -> None:
    """Write rows, the names of the columns first, whole."""
    with whole_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as stream:
        csv.writer(stream, lineterminator=lineterminator).writerows(rows)


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """A temporary folder beside `path` to fill; it becomes `path` when the block ends without error.

    `InputError` if there is something at `path` other than an empty folder, or the place cannot be written to.
    """
    check_new_folder(path)
    # what is really written, where `path` ends in a dot or is a link
    target = path.resolve()
    with _input_errors(target.parent, "cannot be written to"):
        temporary = Path(tempfile.mkdtemp(dir=target.parent, prefix=f"{UNFINISHED}{target.name}-"))
    _unfinished.add(temporary)
    try:
        yield temporary
        _make_public(temporary, 0o777)
        for folder, _, names in os.walk(temporary, topdown=False):
            for name in names:
                _to_disk(Path(folder, name))
            _entries_to_disk(Path(folder))
        if target.is_dir():
            # an empty one; not every system renames onto it
            target.rmdir()
        temporary.rename(target)
        _entries_to_disk(target.parent)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
        _unfinished.discard(temporary)


@contextmanager
def _input_errors(path: Path, what: str) -> Iterator[None]:
    """What the system refuses in the block is bad input, unless the disk is full."""
    try:
        yield
    except OSError as error:
        if is_full(error):
            raise
        raise InputError(f"{path}: {what}: {error.strerror}") from None


def _make_public(path: Path, rights: int) -> None:
    """Give it the rights that any new file or folder has: temporary ones are made private."""
    mask = os.umask(0)
    os.umask(mask)
    path.chmod(rights & ~mask)


def _to_disk(path: Path, flags: int = os.O_RDWR | getattr(os, "O_BINARY", 0)) -> None:
    """Wait until what was written to a file is on the disk: a name may be there sooner than its content."""
    descriptor = os.open(path, flags)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _entries_to_disk(folder: Path) -> None:
    """The same of the names in a folder, where the system knows that."""
    with suppress(OSError):
        _to_disk(folder, os.O_RDONLY)


def check_new_folder(path: Path) -> None:
    """`InputError` if a folder cannot be made there, or there is one that is not empty."""
    if path.is_dir():
        if any(path.iterdir()):
            raise InputError(f"{path}: there is a folder of that name that is not empty: choose another one")
    elif path.exists() or path.is_symlink():
        raise InputError(f"{path}: there is a file of that name: choose another one")
    _check_folder(path.resolve().parent)


def safe_name(name: str) -> str:
    """A file name made from free text: it must not become a path, nor be too long for one."""
    return re.sub(r"[^\w.-]+", "-", name)[:80] or "unnamed"


def check_writable(path: Path, overwrite: bool = True) -> None:
    """`InputError` if a file cannot be written there, or must not: to know it before long work, not after."""
    if path.is_dir():
        raise InputError(f"{path}: cannot be written: there is a folder of that name")
    if not overwrite and path.exists():
        raise InputError(f"{path}: is there already: --overwrite replaces it")
    _check_folder(path.parent)


def _check_folder(path: Path) -> None:
    if not path.is_dir():
        raise InputError(f"{path}: cannot be written to: no such folder")
    if not os.access(path, os.W_OK | os.X_OK):
        raise InputError(f"{path}: cannot be written to")


def remove_unfinished() -> None:
    """Remove what is half-written, before the process is ended from outside the block that writes it."""
    for temporary in list(_unfinished):
        remove(temporary)


def remove_leftovers(folder: Path) -> None:
    """Remove what a process that was killed left half-written in a folder, which no other process may be writing to."""
    for left in folder.glob(f"{UNFINISHED}*"):
        if left not in _unfinished:
            remove(left)


def remove(path: Path) -> None:
    """Remove a file, a link or a folder with all that is in it."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def output_folder(path: Path) -> Path:
    """Make a folder for output if it is not there; `InputError` if it cannot be one."""
    with _input_errors(path, "cannot be made a folder for output"):
        path.mkdir(parents=True, exist_ok=True)
    # known now, not only when there is something to write
    _check_folder(path)
    return path


def check_output_folder(path: Path) -> None:
    """As `output_folder`, and leave no folder that was not there: to know it before long work, not after."""
    made = [folder for folder in (path, *path.parents) if not folder.exists()]
    try:
        output_folder(path)
    finally:
        for folder in made:
            if folder.is_dir():
                folder.rmdir()
