"""Limits on what the reading of a file may take and do: some readers wait for ever for the end of one that is cut off,
ask for all the memory that a counter in it speaks of, print, or leave the program."""

import io
import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from types import FrameType

#: Seconds of computing for any file, and for each million bytes of it: a hundred times what a slow format takes.
SECONDS, SECONDS_PER_MEGABYTE = 8.0, 5.0
#: Bytes of memory for any file, and for each byte of it: a digit and a blank are a number of eight bytes, which
#: readers copy several times.
MEMORY, MEMORY_PER_BYTE = 1 << 30, 40


@contextmanager
def patience(path: Path) -> Iterator[None]:
    """Raise `TimeoutError` or `MemoryError` in the block if it takes more than reading a file of that size can.

    What the block prints is lost, and where it leaves the program `ValueError` is raised: meshio does both where it
    gives up.

    Time is what this process computes, so that a busy machine makes no file wrong; it works in the main thread on
    systems with timers, which is where commands read. Memory is bounded where there are limits of the address space.
    Elsewhere there is no limit.
    """
    size = path.stat().st_size
    printed = io.StringIO()
    try:
        with (
            redirect_stdout(printed),
            redirect_stderr(printed),
            _time(SECONDS + SECONDS_PER_MEGABYTE * size / 1e6),
            _memory(MEMORY + MEMORY_PER_BYTE * size),
        ):
            yield
    except SystemExit:
        raise ValueError("its reader gave up") from None


@contextmanager
def _time(seconds: float) -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "setitimer"):
        yield
        return

    def give_up(_number: int, _frame: FrameType | None) -> None:
        raise TimeoutError(f"no end after {seconds:.0f} s: is the file cut off?")

    before = signal.signal(signal.SIGPROF, give_up)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


@contextmanager
def _memory(limit: int) -> Iterator[None]:
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    except (OSError, ValueError, IndexError):
        pages = 0
    if not pages:
        # a system that does not say how much of its address space a process has
        yield
        return
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    wanted = pages * os.sysconf("SC_PAGE_SIZE") + limit
    if soft != resource.RLIM_INFINITY:
        wanted = min(wanted, soft)
    resource.setrlimit(resource.RLIMIT_AS, (wanted, hard))
    try:
        yield
    except MemoryError:
        raise MemoryError(f"needs more than {limit / 1e9:.1f} GB of memory: is a counter in it wrong?") from None
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
