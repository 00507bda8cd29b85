"""A folder of results belongs to one process at a time, from before anything is computed until the command ends.

The lock is on the folder itself and is the system's: it leaves no file behind, and goes with the process however that
ends. Where there are no such locks (Windows, some file systems of networks) nothing is claimed.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from types import ModuleType

from warpbrain.atomic import output_folder, remove_leftovers
from warpbrain.errors import InputError

fcntl: ModuleType | None
try:
    import fcntl
except ImportError:  # no POSIX
    fcntl = None

#: Descriptors of the folders that this process has, and the folders that it made for each, the innermost first.
_claims: dict[Path, tuple[int | None, list[Path]]] = {}


class TakenError(InputError):
    """Another process writes to the folder."""


def claim(path: Path) -> None:
    """Make a folder if it is not there, and have it for this process alone until `release`.

    What a process that was killed left half-written in it is taken away.

    Raises
    ------
    TakenError
        If another process has it.
    InputError
        If it cannot be a folder, or be written to.
    """
    place = path.resolve()
    if place in _claims and place.is_dir():
        return
    while True:
        made = [folder for folder in (place, *place.parents) if not folder.exists()]
        try:
            output_folder(path)
            descriptor = _lock(place)
        except FileNotFoundError:
            # whoever had it found no use for it, and took it away in this moment
            continue
        except InputError:
            _remove_empty(made)
            raise
        _claims[place] = (descriptor, made)
        remove_leftovers(place)
        return


def release() -> None:
    """Give all folders back; those that were made, and have nothing in them, go again."""
    while _claims:
        _, (descriptor, made) = _claims.popitem()
        _remove_empty(made)
        if descriptor is not None:
            os.close(descriptor)


def _lock(folder: Path) -> int | None:
    if fcntl is None:
        return None
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise TakenError(f"{folder}: another process is writing its results there: choose another folder") from None
    except OSError:
        # a file system that has no locks
        return descriptor
    try:
        same = os.path.samestat(os.fstat(descriptor), os.stat(folder))
    except FileNotFoundError:
        same = False
    if not same:
        os.close(descriptor)
        raise FileNotFoundError(folder)
    return descriptor


def _remove_empty(folders: list[Path]) -> None:
    with suppress(OSError):
        for folder in folders:
            folder.rmdir()
