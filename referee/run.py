"""Lets the tool diagnose every case as a user would: the command line, and nothing but the case folder."""

from __future__ import annotations

import csv
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

import warpbrain
from warpbrain.errors import InputError

#: The list of runs, in the folder of results.
RUNS = "runs.csv"
COLUMNS = ("case", "status", "seconds", "version", "commit", "arguments")
#: What the tool writes into the folder of a case.
DIAGNOSIS = "diagnosis.json"


def run_all(cases: Path, out: Path, device: str | None, workers: int, more: Sequence[str]) -> int:
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

    Returns
    -------
    int
        1 if any run ended with another exit status than 0, else 0.
    """
    folders = sorted(path.parent for path in cases.glob("*/case.toml"))
    if not folders:
        raise InputError(f"{cases}: no folder in it has a case.toml")
    out.mkdir(parents=True, exist_ok=True)
    done = {row["case"]: int(row["status"]) for row in read_runs(out)}
    arguments = [*(["--device", device] if device else []), *more]
    about = (warpbrain.__version__, _commit())
    with ThreadPoolExecutor(workers) as pool:
        waiting = [folder for folder in folders if folder.name not in done]
        jobs = {pool.submit(_run, folder, out / folder.name, arguments): folder.name for folder in waiting}
        for job in as_completed(jobs):
            status, seconds = job.result()
            done[jobs[job]] = status
            # a row is written once its run has ended: what was interrupted is run again
            _add(out, (jobs[job], status, f"{seconds:.1f}", *about, " ".join(arguments)))
            print(f"{jobs[job]}: exit status {status} after {seconds:.0f} s", flush=True)
    return int(any(done[folder.name] != 0 for folder in folders))


def read_runs(out: Path) -> list[dict[str, str]]:
    """Rows of the list of runs; none if there is no list."""
    file = out / RUNS
    if not file.exists():
        return []
    with file.open(newline="", encoding="utf-8") as lines:
        return list(csv.DictReader(lines))


def _run(folder: Path, out: Path, arguments: Sequence[str]) -> tuple[int, float]:
    shutil.rmtree(out, ignore_errors=True)
    out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="referee-") as alone:
        # a copy, so that nothing beside the folder can be found from it
        copy = Path(alone) / folder.name
        shutil.copytree(folder, copy)
        command = [sys.executable, "-m", "warpbrain", "diagnose", "--case", str(copy), "--out", str(out.absolute())]
        started = time.perf_counter()
        ended = subprocess.run([*command, *arguments], cwd=alone, capture_output=True, text=True, check=False)
        seconds = time.perf_counter() - started
    log = out.parent / f"{out.name}.log"
    log.write_text(ended.stdout + ended.stderr, encoding="utf-8")
    return ended.returncode, seconds


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
