"""The folder that a command writes its results to: never one that has results already or that another process writes
to, and none that is left empty.

It belongs to one process at a time, from before anything is computed until the command ends. The lock is on the folder
itself and is the system's: it leaves no file behind, and goes with the process however that ends. Where there are no
such locks (Windows, some file systems of networks) nothing is claimed.
"""

import os
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path
from types import ModuleType

from warpbrain.atomic import output_folder, remove, remove_leftovers
from warpbrain.errors import InputError
from warpbrain.terminal.record import LOG, Record, files_of

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

    What a process that was killed left half-written in it is taken away. `TakenError` if another process has it,
    `InputError` if it cannot be a folder, or be written to.
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


#: What tells a folder of results: the file that each command writes last, or first if it goes on with what is there.
MARKS = ("summary.json", "estimate.json", "diagnosis.json", "ensemble.json", "sweep.csv")


def choose_folder(requested: Path | None, usual: str, overwrite: bool, allowed_marks: Collection[str] = ()) -> Path:
    """Where results are to be written, known before anything is computed; this process alone has it until it ends.

    Without one that is asked for it is of the usual name, in the working folder; where that has results, or another
    process writes to it, the next free one of ``NAME-2``, ``NAME-3``, ... Of `MARKS` the allowed ones may lie in it:
    what the command reads or goes on with. `InputError` if the folder that was asked for has results and may not be
    overwritten, belongs to another process, cannot be one or be written to.
    """

    def results_of(folder: Path) -> list[str]:
        return [name for name in MARKS if name not in allowed_marks and (folder / name).exists()]

    folder = requested or Path(usual)
    if requested is not None or overwrite:
        claim(folder)
        if not overwrite and (marks := results_of(folder)):
            raise InputError(f"{folder}: has results already ({', '.join(marks)}): --overwrite replaces them")
        return folder
    for number in count(2):
        if not results_of(folder):
            with suppress(TakenError):
                claim(folder)
                # known for sure only now that nobody else can write some
                if not results_of(folder):
                    break
        folder = Path(f"{usual}-{number}")
    return folder


@contextmanager
def results_in(path: Path, record: Record, replace: bool) -> Iterator[None]:
    """The folder that results are written to in the block, for this process alone; says what was written when it ends,
    and writes the log.

    If the results `replace` earlier ones, what these left there by their log and the block did not write is taken away
    at the end, for nobody should take it for new. The file that says what they are goes first: a process that is killed
    in the block leaves nothing that could be taken for results, old or new. `InputError` as of `claim`.
    """
    made = not path.exists()
    claim(path)
    earlier = files_of(path)
    if replace and (path / LOG).exists():
        record.write(path, "not yet: its results are being written, or were when it was killed", replace=False)
        _remove(path, set(MARKS) & set(earlier))
    try:
        yield
    except BaseException as error:
        # a full disk has no place for a log of it
        with suppress(OSError, InputError):
            if any(path.iterdir()):
                record.write(path, f"{type(error).__name__}: {error}", replace=False)
            elif made:
                path.rmdir()
        raise
    if replace:
        _remove(path, set(earlier) - set(record.files))
    record.say("", f"written to {path}: {', '.join(record.files)}")
    record.write(path, "done", replace)


def _remove(folder: Path, names: Iterable[str]) -> None:
    """Take files or folders of results away that are in the folder of results itself."""
    for name in names:
        if Path(name).name == name and name not in ("", ".", ".."):
            remove(folder / name)
