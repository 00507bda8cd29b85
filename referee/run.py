"""Lets the tool diagnose every case as a user would: the command line, and nothing but the case folder."""

from __future__ import annotations

import csv
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

import warpbrain
from referee.errors import InputError
from referee.runs import COLUMNS, RUNS, read_runs
from warpbrain.physics.mechanisms import mechanisms

#: Status of a run that took too long.
NO_DIAGNOSIS = "no diagnosis"


def run_all(
    cases: Path,
    out: Path,
    device: str | None,
    workers: int,
    more: Sequence[str],
    limit: float | None = None,
    left_out: Mapping[str, str] | None = None,
) -> int:
    """Run the tool on every case that has not been run; list every run.

    Parameters
    ----------
    cases : Path
        Folder of case folders.
    out : Path
        Gets a folder for each case, and `runs.csv`.
    device : str or None
    workers : int
        How many run at a time.
    more : sequence of str
        Further arguments of the tool.
    limit : float, optional
        Seconds of a case, after which it is stopped and listed as `NO_DIAGNOSIS`.
    left_out : mapping of str to str, optional
        By case the mechanism that is taken out of the tool's dictionary; other cases are not run then.

    Returns
    -------
    int
        1 if any run was stopped or ended with another exit status than 0, else 0.
    """
    folders = case_folders(cases)
    if left_out is not None:
        folders = [folder for folder in folders if folder.name in left_out]
    out.mkdir(parents=True, exist_ok=True)
    done = {row["case"]: row["status"] for row in read_runs(out)}
    arguments = [*(["--device", device] if device else []), *more]
    about = (warpbrain.__version__, _commit())
    with ThreadPoolExecutor(workers) as pool:
        waiting = [folder for folder in folders if folder.name not in done]
        words = {f.name: [*arguments, *_without((left_out or {}).get(f.name, ""))] for f in folders}
        jobs = {pool.submit(_run, f, out / f.name, words[f.name], limit): f.name for f in waiting}
        for job in as_completed(jobs):
            status, seconds = job.result()
            done[jobs[job]] = status
            # a row is written once its run has ended: what was interrupted is run again
            name = jobs[job]
            _add(out, (name, status, f"{seconds:.1f}", *about, " ".join(words[name]), (left_out or {}).get(name, "")))
            said = status if status == NO_DIAGNOSIS else f"exit status {status}"
            print(f"{name}: {said} after {seconds:.0f} s", flush=True)
    return int(any(done[folder.name] != "0" for folder in folders))


def case_folders(cases: Path) -> list[Path]:
    """Case folders of a set; `InputError` if there are none."""
    folders = sorted(path.parent for path in cases.glob("*/case.toml"))
    if not folders:
        raise InputError(f"{cases}: no folder in it has a case.toml")
    return folders


def _without(mechanism: str) -> list[str]:
    """Arguments of the tool that take a mechanism out of its dictionary."""
    if not mechanism:
        return []
    return ["--candidates", ",".join(name for name in mechanisms() if name != mechanism)]


def _run(folder: Path, out: Path, arguments: Sequence[str], limit: float | None) -> tuple[str, float]:
    shutil.rmtree(out, ignore_errors=True)
    out.parent.mkdir(parents=True, exist_ok=True)
    log = out.parent / f"{out.name}.log"
    with tempfile.TemporaryDirectory(prefix="referee-") as alone, log.open("w", encoding="utf-8") as told:
        # a copy, so that nothing beside the folder can be found from it
        copy = Path(alone) / folder.name
        shutil.copytree(folder, copy)
        command = [sys.executable, "-m", "warpbrain", "diagnose", "--case", str(copy), "--out", str(out.absolute())]
        started = time.perf_counter()
        try:
            ended = subprocess.run(
                [*command, *arguments], cwd=alone, stdout=told, stderr=subprocess.STDOUT, check=False, timeout=limit
            )
            status = str(ended.returncode)
        except subprocess.TimeoutExpired:
            status = NO_DIAGNOSIS
            shutil.rmtree(out, ignore_errors=True)
            told.write(f"stopped after {limit:g} s\n")
        return status, time.perf_counter() - started


def _add(out: Path, row: Sequence[object]) -> None:
    fresh = not (out / RUNS).exists()
    with (out / RUNS).open("a", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        if fresh:
            writer.writerow(COLUMNS)
        writer.writerow(row)


def _commit() -> str:
    """The commit of the tool, if it is run from a repository; with a + if there are changes since."""
    place = Path(warpbrain.__file__).parent
    try:
        commit = _git(place, "rev-parse", "HEAD")
        return commit + ("+" if _git(place, "status", "--porcelain", "--", ".") else "")
    except (OSError, subprocess.CalledProcessError):
        return ""


def _git(place: Path, *words: str) -> str:
    done = subprocess.run(["git", "-C", str(place), *words], capture_output=True, text=True, check=True)
    return done.stdout.strip()
