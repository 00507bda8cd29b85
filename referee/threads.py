"""Threads and memory of a worker process."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from typing import Any

from referee.errors import InputError

#: Of glibc's `malloc.h`.
_M_TRIM_THRESHOLD, _M_MMAP_MAX = -1, -4


def single() -> None:
    """One thread for linear algebra, since there is a process for each core already, and memory that is kept.

    Where glibc gives each large array back to the system when it is done with, a fifth of the time goes into getting it
    again.
    """
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"
    if hasattr(libc := ctypes.CDLL(None), "mallopt"):
        libc.mallopt(_M_MMAP_MAX, 0)
        libc.mallopt(_M_TRIM_THRESHOLD, 2**31 - 1)


@contextmanager
def mapped(workers: int) -> Iterator[Callable[..., Iterator[Any]]]:
    """`map`, results in order: in this process, or over so many fresh ones, which know nothing of its threads."""
    if workers < 1:
        raise InputError(f"--workers {workers}: expected 1 or more")
    if workers == 1:
        yield map
        return
    with ProcessPoolExecutor(max_workers=workers, mp_context=get_context("spawn"), initializer=single) as pool:
        yield pool.map
