"""Ctrl-C within a second, even while a kernel is being compiled.

Python acts on a signal only between two of its own instructions, and compiling a kernel or a long launch is one. The
signal itself is noticed at once through a wake-up descriptor: a thread waits on it and, if Python has not come to its
senses shortly after, ends the process. Files are whole or not there at all (`warpbrain.atomic`), and what was being
written under a temporary name is removed first.
"""

import os
import shutil
import signal
import socket
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from warpbrain.atomic import remove_unfinished
from warpbrain.terminal.result_folder import release
from warpbrain.threads import is_working_beside

#: Seconds that Python is given to stop by itself.
_GRACE = 0.6


def clear_up(program: str) -> None:
    """Remove what an interrupted process leaves, half-written files, empty folders, folders of half-built kernels, and
    say so."""
    remove_unfinished()
    release()
    warp = sys.modules.get("warp")
    cache = warp.config.kernel_cache_dir if warp else None
    if cache:
        # Warp builds a kernel in a folder that carries the process id, and moves it when it is done
        for unfinished in Path(cache).glob(f"*_p{os.getpid()}_t*"):
            shutil.rmtree(unfinished, ignore_errors=True)
    print(f"\n{program}: interrupted; nothing half-written was left", file=sys.stderr, flush=True)


def leave_threads() -> None:
    """End the process with the status of an interrupted one if a thread compiles kernels or works beside this one.

    Python would wait for that thread, and a compiler finds the folder gone that it writes to.
    """
    module = sys.modules.get("warpbrain.kernels.module")
    if is_working_beside() or (module is not None and module.is_compiling()):
        os._exit(130)


@contextmanager
def stop_promptly() -> Iterator[None]:
    """Make Ctrl-C end the process within a second while the block runs; does nothing outside the main thread."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    reader, writer = socket.socketpair()
    writer.setblocking(False)
    finished = threading.Event()

    def watch() -> None:
        while data := reader.recv(1):
            if data[0] == signal.SIGINT and not finished.wait(_GRACE):
                clear_up("warpbrain")
                os._exit(130)

    previous = signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)
    watcher = threading.Thread(target=watch, name="interrupt", daemon=True)
    watcher.start()
    try:
        yield
    finally:
        finished.set()
        signal.set_wakeup_fd(previous)
        writer.close()
        watcher.join(timeout=1.0)
        reader.close()
