"""The folder that a command writes its results to: never one that has results already, and none that is left empty."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from warpbrain.atomic import check_output_folder, output_folder
from warpbrain.errors import InputError
from warpbrain.terminal.record import Record, files_of

#: What tells a folder of results: the file that each command writes last, or first if it goes on with what is there.
MARKS = ("summary.json", "estimate.json", "diagnosis.json", "ensemble.json", "sweep.csv")


def choose_folder(asked: Path | None, usual: str, overwrite: bool, beside: Iterable[str] = ()) -> Path:
    """Where results are to be written, known before anything is computed; nothing is made yet.

    Parameters
    ----------
    asked : Path or None
        What ``--out`` says. None: a folder of the usual name in the working folder; where it has results, the next
        free one of ``NAME-2``, ``NAME-3``, ...
    usual : str
    overwrite : bool
        Whether results that are there may be replaced.
    beside : iterable of str
        Of `MARKS`, what may lie in the folder: what the command reads or goes on with.

    Raises
    ------
    InputError
        If the folder that was asked for has results and may not be overwritten, cannot be one or be written to.
    """
    folder = _chosen(asked, usual, overwrite, beside)
    check_output_folder(folder)
    return folder


def _chosen(asked: Path | None, usual: str, overwrite: bool, beside: Iterable[str]) -> Path:
    if asked is None:
        folder, number = Path(usual), 1
        while not overwrite and _has_results(folder, beside):
            number += 1
            folder = Path(f"{usual}-{number}")
        return folder
    if not overwrite and (marks := _has_results(asked, beside)):
        raise InputError(f"{asked}: has results already ({', '.join(marks)}): --overwrite replaces them")
    return asked


def _has_results(folder: Path, beside: Iterable[str]) -> list[str]:
    allowed = set(beside)
    return [name for name in MARKS if name not in allowed and (folder / name).exists()]


@contextmanager
def results_in(path: Path, record: Record, replace: bool) -> Iterator[None]:
    """Make the folder that results are written to in the block, and write the log when it ends.

    A folder that was made for nothing goes again.

    Parameters
    ----------
    path : Path
    record : Record
        Its `files` say what was written.
    replace : bool
        Whether the results take the place of earlier ones: what these left there by their log and the block did not
        write is taken away at the end, for nobody should take it for new.

    Raises
    ------
    InputError
        If it cannot be a folder, or be written to.
    """
    made = not path.exists()
    folder = output_folder(path)
    earlier = files_of(folder)
    try:
        yield
    except BaseException as error:
        if any(folder.iterdir()):
            record.write(folder, f"{type(error).__name__}: {error}", replace=False)
        elif made:
            folder.rmdir()
        raise
    if replace:
        for name in set(earlier) - set(record.files):
            _remove(folder, name)
    record.write(folder, "done", replace)


def _remove(folder: Path, name: str) -> None:
    """Take a file or folder of results away, if it is in the folder of results itself."""
    path = folder / name
    if Path(name).name != name or name in ("", ".", ".."):
        return
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)
