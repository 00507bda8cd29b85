"""Commands that are killed at a random moment, or that find the disk full, and what then lies in their folder.

A command is run in a fork of this process, where its kernels are loaded, and ended by one of

- `moment`: killed by the system after a random time of computing;
- `event`: SIGKILL before a random one of its operations on the folder: open, rename, mkdir, remove;
- `write`: killed by the system in the middle of a write, with so many bytes of a file on the disk;
- `full`: the same write fails, as on a full disk, and the command has to say so.

Then: each file that has its final name is whole and as it was before or as it is to be; a folder with the file that
says what its results are holds all of one command; and the same command again ends as if nothing had been.
"""

from __future__ import annotations

import io
import json
import os
import resource
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from damage.commands_to_kill import Command, commands
from warpbrain.cli import main
from warpbrain.terminal.quiet import start_warp_quietly
from warpbrain.terminal.record import LOG
from warpbrain.terminal.result_folder import MARKS

WAYS = ("moment", "event", "write", "full")
_EVENTS = {"open", "os.rename", "os.mkdir", "os.rmdir", "os.remove", "os.chmod", "os.truncate"}
#: What grows while a command computes, so that it need not be as it is to be.
_GROWING = ("samples/", "sweep.csv")
#: Keys of JSON whose values are not the same twice.
_CLOCKS = ("second", "time_ms", "timing", "began", "phases", "versions")


@dataclass(frozen=True)
class Whole:
    """What a command does if it is let: its files, and how often and how long it can be killed."""

    files: dict[str, Any]
    events: int
    seconds: float
    longest: int


@dataclass(frozen=True)
class Killed:
    """What came of a try; `defect` is empty if nothing was wrong."""

    seed: int
    command: str
    way: str
    status: int
    defect: str


def killers(place: Path, names: Sequence[str] = ()) -> dict[str, Callable[[int], Killed]]:
    """For each command, by name, what kills it: a function of the seed."""
    start_warp_quietly()
    killing: dict[str, Callable[[int], Killed]] = {}
    for command in commands(place / "cases"):
        if names and command.name not in names:
            continue
        room = place / command.name
        (room / "whole").mkdir(parents=True)
        # what it imports is there for all its forks
        with command.prepared(), redirect_stdout(io.StringIO()):
            main([*command.arguments, "--out", str(room / "warm")])
        whole, earlier = whole_of(command, room / "whole"), None
        if command.others:
            (room / "earlier").mkdir()
            whole_of(replace(command, arguments=command.others), room / "earlier")
            earlier = room / "earlier" / "out"
        killing[command.name] = partial(_in_a_room_of_its_own, command, whole, earlier, room)
    return killing


def _in_a_room_of_its_own(command: Command, whole: Whole, earlier: Path | None, room: Path, seed: int) -> Killed:
    with tempfile.TemporaryDirectory(dir=room) as place:
        return one_kill(command, whole, earlier, Path(place), seed)


def whole_of(command: Command, place: Path) -> Whole:
    """Let a command end."""
    out, counter = place / "out", place / "count"
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    status, said = _forked(command, out, lambda: _count(place, counter))
    if status != 0:
        raise AssertionError(f"{command.name}: status {status}: {said}")
    seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    longest = max(path.stat().st_size for path in out.rglob("*") if path.is_file())
    return Whole(contents(out), len(counter.read_bytes()), seconds, longest)


def one_kill(command: Command, whole: Whole, earlier: Path | None, place: Path, seed: int) -> Killed:
    """Kill a command in an empty folder, or where it replaces earlier results, look, and repeat it."""
    rng = np.random.default_rng(seed)
    way = WAYS[rng.integers(len(WAYS))]
    out = place / "out"
    before: dict[str, Any] = {}
    replacing = earlier is not None and rng.random() < 0.5
    if replacing:
        shutil.copytree(earlier, out)
        before = contents(out)
    fraction = float(rng.random())
    status, said = _forked(command, out, lambda: _end(way, fraction, whole, place), overwrite=replacing)
    defect = _look(out, before, whole.files, command)
    if way == "full" and status not in (0, 1):
        defect += f"status {status} of a full disk; "
    if way == "full" and status == 1 and (said.count("\n") != 1 or "Traceback" in said):
        defect += "not one line; "
    defect += _again(command, out, whole, said)
    return Killed(seed, command.name, way, status, f"{defect}said {said[-300:]!r}" if defect else "")


def _again(command: Command, out: Path, whole: Whole, said: str) -> str:
    status, said = _forked(command, out, lambda: None)
    if status == 2 and "has results already" in said:
        status, said = _forked(command, out, lambda: None, overwrite=True)
    if status != 0:
        return f"the same command again: status {status}: {said}; "
    after = contents(out)
    wrong = [name for name in whole.files.keys() | after.keys() if whole.files.get(name) != after.get(name)]
    return f"after the same command again {sorted(wrong)} differ; " if wrong else ""


def _look(out: Path, before: dict[str, Any], to_be: dict[str, Any], command: Command) -> str:
    """What is wrong with a folder that a command was killed in."""
    now = {name: content for name, content in contents(out).items() if ".unfinished-" not in name}
    defect = ""
    for name, content in now.items():
        if name.startswith(_GROWING) and content is not None:
            continue
        if content is None or content not in (before.get(name), to_be.get(name)):
            defect += f"{name} is neither old nor new; "
    for mark in set(MARKS) & now.keys() - set(command.goes_on_with):
        generation = to_be if now[mark] == to_be.get(mark) else before
        wrong = [n for n in command.told_of if now.get(n) != generation.get(n)]
        if wrong:
            defect += f"{mark} beside {wrong} that are not of it; "
    return defect


def contents(folder: Path) -> dict[str, Any]:
    """What is to be the same twice of the files of a folder; None of a file that is not whole."""
    found: dict[str, Any] = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.is_file() and path.name != LOG:
            found[name] = _content(path)
    return found


def _content(path: Path) -> Any:
    content = path.read_bytes()
    if path.name.startswith(".unfinished-"):
        return "unfinished"
    if path.suffix == ".json":
        try:
            return _without_clocks(json.loads(content))
        except ValueError:
            return None
    if path.name == "sweep.csv":
        return _numbers(content.decode())
    ends = {".html": b"</html>", ".png": b"IEND\xaeB`\x82"}
    if path.suffix in ends:
        # its clocks are in the middle of it
        return "whole" if content.rstrip().endswith(ends[path.suffix]) else None
    if path.suffix == ".npz":
        with np.load(path) as arrays:
            return {name: values.tobytes() for name, values in arrays.items()}
    return content


def _numbers(table: str) -> list[list[str]]:
    """A sweep to five digits: each state is looked for from the one before it, where there is one since the start."""
    rows = [row.split(",")[:-1] for row in table.splitlines()]
    return rows[:1] + [[f"{float(cell):.5g}" if cell else "" for cell in row] for row in rows[1:]]


def _without_clocks(said: Any) -> Any:
    if isinstance(said, dict):
        return {key: _without_clocks(value) for key, value in said.items() if not any(word in key for word in _CLOCKS)}
    return [_without_clocks(value) for value in said] if isinstance(said, list) else said


# -- in the fork ----------------------------------------------------------------------------------------------------


def _forked(command: Command, out: Path, prepare: Callable[[], None], overwrite: bool = False) -> tuple[int, str]:
    """Run a command in a fork; its status, negative for a signal, and what it said on standard error."""
    sys.stdout.flush()
    sys.stderr.flush()
    reader, writer = os.pipe()
    process = os.fork()
    if process == 0:
        status = 99
        try:
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            os.dup2(writer, 2)
            os.close(reader)
            sys.stdout, sys.stderr = os.fdopen(1, "w"), os.fdopen(2, "w")
            os.chdir(out.parent)
            arguments = [*command.arguments, "--out", str(out), *(["--overwrite"] if overwrite else [])]
            with command.prepared():
                prepare()
                status = main(arguments)
            sys.stderr.flush()
        finally:
            os._exit(status)
    os.close(writer)
    with os.fdopen(reader, "rb") as stream:
        said = stream.read().decode(errors="replace")
    _, ended = os.waitpid(process, 0)
    return os.waitstatus_to_exitcode(ended), said


def _count(place: Path, counter: Path) -> None:
    descriptor = os.open(counter, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    _at_events(place / "out", lambda: os.write(descriptor, b"."))


def _end(way: str, fraction: float, whole: Whole, place: Path) -> None:
    """Have this process end somewhere."""
    if way == "moment":
        # ends a process as SIGKILL does: the system does it, and no code of ours runs
        signal.signal(signal.SIGVTALRM, signal.SIG_DFL)
        # of what it computes, so that a busy machine does not change the moment
        signal.setitimer(signal.ITIMER_VIRTUAL, max(1e-4, fraction * whole.seconds))
    elif way == "event":
        left = [int(fraction * whole.events)]

        def kill() -> None:
            if not left[0]:
                os.kill(os.getpid(), signal.SIGKILL)
            left[0] -= 1

        _at_events(place / "out", kill)
    else:
        signal.signal(signal.SIGXFSZ, signal.SIG_DFL if way == "write" else signal.SIG_IGN)
        # small files are the many: bytes on a scale of orders
        size = int(whole.longest**fraction)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))


def _at_events(folder: Path, call: Callable[[], object]) -> None:
    """Call something before each operation on what is in a folder."""
    inside, there = str(folder), []

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        if event in _EVENTS and not there and str(arguments[0]).startswith(inside):
            there.append(True)
            call()
            there.clear()

    sys.addaudithook(hook)
