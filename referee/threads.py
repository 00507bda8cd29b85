"""Threads of a worker process."""

from __future__ import annotations

import os


def single() -> None:
    """One thread for linear algebra: there is a process for each core already."""
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"
