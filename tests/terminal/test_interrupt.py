"""Ctrl-C: the program is gone within a second, whatever it is doing, and nothing half-written stays."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from busy import slowness

pytestmark = [
    pytest.mark.skipif(os.name != "posix", reason="sends POSIX signals"),
    pytest.mark.usefixtures("ctrl_c"),
]

#: Seconds from the signal to the end: one is promised; twice that, and as many times as a busy machine is slower.
PATIENCE = 2.0


@contextmanager
def started(*arguments: str, **environment: str) -> Iterator[subprocess.Popen[str]]:
    """The command in a process of its own, which does not outlive the test."""
    command = [sys.executable, "-u", *arguments]
    surroundings = {**os.environ, **environment}
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=surroundings
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def interrupt(process: subprocess.Popen[str]) -> str:
    """Press Ctrl-C; returns what was said on standard error."""
    patience = PATIENCE * slowness()
    start = time.monotonic()
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=30 + patience)
    seconds = time.monotonic() - start
    assert process.returncode == 130
    assert seconds < patience
    return err.strip()


def wait_for(line: str, process: subprocess.Popen[str]) -> None:
    assert process.stdout is not None
    for text in process.stdout:
        if line in text:
            return
    raise AssertionError(f"ended without '{line}'")


def wait_until(happened: Callable[[], bool], seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not happened():
        assert time.monotonic() < end
        time.sleep(0.02)


def phantom(out: Path) -> list[str]:
    return ["-m", "warpbrain", "run", "--case", "phantom", "--tissue", "single", "--device", "cpu", "--out", str(out)]


def files(folder: Path) -> list[str]:
    return [str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()]


def test_while_solving(tmp_path):
    with started(*phantom(tmp_path / "out")) as process:
        wait_for("100.0 %      2 ", process)
        assert interrupt(process) == "warpbrain: interrupted; nothing half-written was left"
    assert files(tmp_path) == []


def test_while_a_kernel_is_compiled(tmp_path):
    """Python cannot act on the signal until the compiler returns, many seconds later: something else must."""
    cache = tmp_path / "cache"
    with started(*phantom(tmp_path / "out"), WARP_CACHE_PATH=str(cache)) as process:
        wait_until(lambda: any(cache.glob(f"*/*_p{process.pid}_t*/*.cpp")))
        time.sleep(0.3)
        assert interrupt(process) == "warpbrain: interrupted; nothing half-written was left"
    assert files(tmp_path / "out") == []
    # what is in the cache is whole: a source without its object would be half a kernel
    folders = {path.parent for path in cache.rglob("*.cpp")}
    assert all(list(folder.glob("*.o")) for folder in folders)
    assert not list(cache.glob("*/*_p*_t*"))


def test_while_a_file_is_written(tmp_path):
    """In a call that does not return to Python, with half a file on disk."""
    code = f"""
from hashlib import pbkdf2_hmac
from pathlib import Path
from warpbrain.atomic import whole_file
from warpbrain.terminal.interrupt import stop_promptly

with stop_promptly(), whole_file(Path({str(tmp_path)!r}) / "result.vtu") as temporary:
    temporary.write_text("half")
    print("writing")
    pbkdf2_hmac("sha256", b"", b"", 10**9)
"""
    with started("-c", code) as process:
        wait_for("writing", process)
        assert len(files(tmp_path)) == 1
        time.sleep(0.1)
        assert interrupt(process) == "warpbrain: interrupted; nothing half-written was left"
    assert files(tmp_path) == []


@pytest.mark.slow(3)
def test_while_benching(tmp_path):
    file = tmp_path / "bench.json"
    with started("-m", "warpbrain.bench", "--rows", "mt/fine", "--device", "cpu", "--json", str(file)) as process:
        wait_for("mean (sd) ms", process)
        # who says it, the command or what watches calls that do not return, depends on where it is
        assert ": interrupted; nothing half-written was left" in interrupt(process)
    assert files(tmp_path) == []


def test_while_text_is_executed(tmp_path):
    """As dataclasses and Warp do when they make functions: `python -m` would end by the signal, without a status."""
    (tmp_path / "program.py").write_text("""
from warpbrain.terminal.command import exit_status

raise SystemExit(exit_status("program", lambda: exec("raise KeyboardInterrupt")))
""")
    path = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
    with started("-m", "program", PYTHONPATH=path) as process:
        _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert err.strip() == "program: interrupted; nothing half-written was left"


def test_nothing_is_changed_by_a_run_that_is_not_interrupted():
    from warpbrain.terminal.interrupt import stop_promptly

    before = signal.getsignal(signal.SIGINT)
    with stop_promptly():
        pass
    assert signal.getsignal(signal.SIGINT) is before
    assert signal.set_wakeup_fd(-1) == -1


def test_a_thread_that_works_beside_is_not_waited_for() -> None:
    program = """
import time
from warpbrain.terminal.command import exit_status
from warpbrain.threads import beside

def call():
    beside(lambda: time.sleep(120.0))
    print("begun", flush=True)
    time.sleep(120.0)

raise SystemExit(exit_status("warpbrain", call))
"""
    with started("-c", program, OMP_NUM_THREADS="2") as process:
        wait_for("begun", process)
        assert "interrupted" in interrupt(process)
