"""A limit on how long a file may take to read: some readers wait for ever for the end of a file that is cut off."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

#: Seconds for any file, and for each million bytes of it: a hundred times what a slow disk and a slow format take.
PATIENCE, PATIENCE_PER_MEGABYTE = 20.0, 5.0


@contextmanager
def patience(path: Path) -> Iterator[None]:
    """Raise `TimeoutError` in the block if it takes longer than reading a file of that size can.

    Works in the main thread on systems with timers, which is where commands read; elsewhere it sets no limit.
    """
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "setitimer"):
        yield
        return
    seconds = PATIENCE + PATIENCE_PER_MEGABYTE * path.stat().st_size / 1e6

    def give_up(_number: int, _frame: FrameType | None) -> None:
        raise TimeoutError(f"no end after {seconds:.0f} s: is the file cut off?")

    before = signal.signal(signal.SIGALRM, give_up)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
