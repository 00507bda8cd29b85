"""Slow tests of which others run with every commit; all of them where the table of verification is written."""

from __future__ import annotations

import hashlib
import os
import subprocess
from collections.abc import Mapping, Sequence
from datetime import date
from functools import cache
from pathlib import Path
from typing import TypeVar

import numpy as np

T = TypeVar("T")
#: Variable of the environment of all processes of tests, set by `--verification-rows`.
ALL = "ALL_SLOW_TESTS"
#: Variable with which .ci/run leaves half of the files of slow tests to other commits.
HALF = "HALF_OF_SLOW_TESTS"


@cache
def _version() -> bytes:
    """The commit, or the day where there is no repository."""
    command = ["git", "rev-parse", "HEAD"]
    try:
        return subprocess.run(command, cwd=Path(__file__).parent, capture_output=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return str(date.today()).encode()


def _seed(name: str = "") -> int:
    return int.from_bytes(hashlib.sha256(_version() + name.encode()).digest()[:8], "big")


def drawn_for_this_commit(of: int, count: int) -> list[int]:
    """So many of the numbers below `of`: others with every commit, or with every day where there is no repository."""
    return sorted(np.random.default_rng(_seed()).choice(of, count, replace=False).tolist())


def half_for_this_commit(seconds: Mapping[str, float]) -> set[str]:
    """Half of some files of tests that take so long: of each two that take about as long, one or the other."""
    slowest_first = sorted(seconds, key=lambda name: (-seconds[name], name))
    pairs = [slowest_first[start : start + 2] for start in range(0, len(slowest_first), 2)]
    return {pair[_seed(pair[0]) % len(pair)] for pair in pairs}


def one_for_this_commit(of: Sequence[T]) -> list[T]:
    """One of some parameters of a test that takes long with each, in a list."""
    return some_for_this_commit(of, 1)


def some_for_this_commit(of: Sequence[T], count: int) -> list[T]:
    """So many of some parameters of a test that takes long with each, in their order; all of them for the table."""
    if ALL in os.environ:
        return list(of)
    return [of[number] for number in drawn_for_this_commit(len(of), count)]
