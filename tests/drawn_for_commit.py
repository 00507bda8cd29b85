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
#: Variable with which .ci/run leaves most of the files of slow tests to other commits.
SOME = "SOME_SLOW_TESTS"
#: Processor seconds of the tests of a file from which it runs with one of eight commits, not four.
_LONG = 60.0
#: Of how many files one runs with a commit.
_OF_LONG, _OF_OTHERS = 8, 4


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


def files_for_this_commit(seconds: Mapping[str, float]) -> set[str]:
    """Of each eight files that take more than a minute one, and of each four others that take about as long."""
    slowest_first = sorted(seconds, key=lambda name: (-seconds[name], name))
    long = sum(taken > _LONG for taken in seconds.values())
    groups = [slowest_first[start : min(start + _OF_LONG, long)] for start in range(0, long, _OF_LONG)]
    groups += [slowest_first[start : start + _OF_OTHERS] for start in range(long, len(slowest_first), _OF_OTHERS)]
    return {group[_seed(group[0]) % len(group)] for group in groups}


def one_for_this_commit(of: Sequence[T]) -> list[T]:
    """One of some parameters of a test that takes long with each, in a list."""
    return some_for_this_commit(of, 1)


def some_for_this_commit(of: Sequence[T], count: int) -> list[T]:
    """So many of some parameters of a test that takes long with each, in their order; all of them for the table."""
    if ALL in os.environ:
        return list(of)
    return [of[number] for number in drawn_for_this_commit(len(of), count)]
