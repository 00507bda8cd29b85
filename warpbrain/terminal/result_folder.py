"""The folder that a command writes its results to: never one that has results already or that another process writes
to, and none that is left empty."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from warpbrain.errors import InputError
from warpbrain.terminal.claim import TakenError, claim
from warpbrain.terminal.record import LOG, Record, files_of

#: What tells a folder of results: the file that each command writes last, or first if it goes on with what is there.
MARKS = ("summary.json", "estimate.json", "diagnosis.json", "ensemble.json", "sweep.csv")


def choose_folder(asked: Path | None, usual: str, overwrite: bool, beside: Iterable[str] = ()) -> Path:
    """Where results are to be written, known before anything is computed; this process alone has it until it ends.

    A folder that was made for nothing goes again when the command ends (`warpbrain.terminal.claim.release`).

    Parameters
    ----------
    asked : Path or None
        What ``--out`` says. None: a folder of the usual name in the working folder; where it has results, or another
        process writes to it, the next free one of ``NAME-2``, ``NAME-3``, ...
    usual : str
    overwrite : bool
        Whether results that are there may be replaced.
    beside : iterable of str
        Of `MARKS`, what may lie in the folder: what the command reads or goes on with.

    Raises
    ------
    InputError
        If the folder that was asked for has results and may not be overwritten, belongs to another process, cannot be
        one or be written to.
    """
    if asked is None and not overwrite:
        return _next_free(usual, tuple(beside))
    folder = asked or Path(usual)
    claim(folder)
    if not overwrite and (marks := _has_results(folder, beside)):
        raise InputError(f"{folder}: has results already ({', '.join(marks)}): --overwrite replaces them")
    return folder


def _next_free(usual: str, beside: Iterable[str]) -> Path:
    folder, number = Path(usual), 1
    while True:
        if not _has_results(folder, beside):
            with suppress(TakenError):
                claim(folder)
                # known for sure only now that nobody else can write some
                if not _has_results(folder, beside):
                    return folder
        number += 1
        folder = Path(f"{usual}-{number}")


def _has_results(folder: Path, beside: Iterable[str]) -> list[str]:
    allowed = set(beside)
    return [name for name in MARKS if name not in allowed and (folder / name).exists()]


@contextmanager
def results_in(path: Path, record: Record, replace: bool) -> Iterator[None]:
    """The folder that results are written to in the block, for this process alone; writes the log when it ends.

    A folder that was made for nothing goes again.

    Parameters
    ----------
    path : Path
    record : Record
        Its `files` say what was written.
    replace : bool
        Whether the results take the place of earlier ones: what these left there by their log and the block did not
        write is taken away at the end, for nobody should take it for new. The file that says what they are goes
        first: a process that is killed in the block leaves nothing that could be taken for results, old or new.

    Raises
    ------
    InputError
        If it cannot be a folder, be written to, or another process writes to it.
    """
    made = not path.exists()
    claim(path)
    earlier = files_of(path)
    if replace and (path / LOG).exists():
        record.write(path, "not yet: its results are being written, or were when it was killed", replace=False)
        for name in set(MARKS) & set(earlier):
            _remove(path, name)
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
        for name in set(earlier) - set(record.files):
            _remove(path, name)
    record.write(path, "done", replace)


def _remove(folder: Path, name: str) -> None:
    """Take a file or folder of results away, if it is in the folder of results itself."""
    path = folder / name
    if Path(name).name != name or name in ("", ".", ".."):
        return
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)
