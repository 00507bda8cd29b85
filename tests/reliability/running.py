"""Tries in several processes, each in a fork of this one, where kernels are loaded; each writes its own line."""

from __future__ import annotations

import contextlib
import json
import multiprocessing
import os
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from datetime import date
from importlib.util import find_spec
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from unittest.mock import patch

from reliability.kinds import KINDS, Tried, Trying
from reliability.table import tries_in
from warpbrain.terminal.quiet import start_warp_quietly


def try_all(
    names: Sequence[str], tries: int | None, first: int, processes: int, seconds: float | None, out: Path
) -> bool:
    """Try what `out` has not yet, until so many seconds have passed; returns whether anything was wrong."""
    end = time.monotonic() + (seconds or 1e6)
    start_warp_quietly()
    out.touch()
    known = {(one["kind"], one["seed"]) for one in tries_in([out])}
    queue: list[tuple[float, str, int]] = []
    trying: dict[str, Trying] = {}
    wrong = False
    with tempfile.TemporaryDirectory() as place, _scratch_in(place):
        for name in names:
            missing = [package for package in KINDS[name].packages if find_spec(package) is None]
            count = KINDS[name].promised if tries is None else tries
            seeds = [seed for seed in range(first, first + count) if (name, seed) not in known]
            if missing:
                print(f"{name}: not tried, for want of {', '.join(missing)}", flush=True)
            elif seeds:
                trying[name] = KINDS[name].prepared(Path(place) / name)
                # all kinds are as far at any time
                queue += [((k + 0.5) / len(seeds), name, seed) for k, seed in enumerate(seeds)]
        queue.sort(reverse=True)
        running: dict[int, tuple[BaseProcess, str, int]] = {}
        try:
            while (queue or running) and (left := end - time.monotonic()) > 0.0:
                if any(KINDS[name].lasts > left for name in trying):
                    queue = [entry for entry in queue if KINDS[entry[1]].lasts <= left]
                while queue and len(running) < processes:
                    _, name, seed = queue.pop()
                    process = multiprocessing.get_context("fork").Process(
                        target=_one, args=(trying[name], name, seed, out)
                    )
                    process.start()
                    with contextlib.suppress(OSError):
                        # here too: whichever is first
                        os.setpgid(process.pid or 0, process.pid or 0)
                    running[process.sentinel] = process, name, seed
                for sentinel in wait(list(running), timeout=max(0.0, end - time.monotonic())):
                    process, name, seed = running.pop(sentinel)  # type: ignore[index]
                    process.join()
                    if process.exitcode not in (0, 1):
                        _write(out, name, seed, 0.0, Tried("", "", None, f"its process ended: {process.exitcode}"))
                    wrong = wrong or process.exitcode != 0
        finally:
            for process, name, seed in running.values():
                print(f"{name} --seed {seed} --tries 1: given up at the end", flush=True)
                # with what it started itself
                with contextlib.suppress(ProcessLookupError, PermissionError):
                    os.killpg(process.pid or 0, signal.SIGKILL)
                process.join()
    return wrong


@contextlib.contextmanager
def _scratch_in(place: str) -> Iterator[None]:
    """What tries that are given up leave lies in a folder that goes."""
    with patch.dict(os.environ, TMPDIR=place), patch.object(tempfile, "tempdir", place):
        yield


def _one(trying: Trying, name: str, seed: int, out: Path) -> None:
    """In a process of its own: try, write the line, end with status 1 if anything was wrong."""
    os.setpgid(0, 0)
    allowed = int(10 * KINDS[name].lasts) + 30
    # of computing, so that a busy machine ends none; what it starts inherits it
    resource.setrlimit(resource.RLIMIT_CPU, (allowed, allowed + 5))
    try:
        tried = trying(seed)
    except BaseException:
        tried = Tried("", "", None, traceback.format_exc())
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    _write(out, name, seed, sum(one.ru_utime + one.ru_stime for one in used), tried)
    if tried.defect:
        print(f"{name} --seed {seed} --tries 1: {tried.what}\n{tried.defect}", flush=True)
    sys.exit(int(bool(tried.defect)))


def _write(out: Path, name: str, seed: int, seconds: float, tried: Tried) -> None:
    line = {"kind": name, "seed": seed, "date": str(date.today()), "seconds": round(seconds, 2), **asdict(tried)}
    # a line that is appended at once is whole
    descriptor = os.open(out, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
    os.write(descriptor, (json.dumps(line) + "\n").encode())
    os.close(descriptor)
