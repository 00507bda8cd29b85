"""Slow tests of which others run with every commit; all of them where the table of verification is written."""

from __future__ import annotations

import hashlib
import os
import subprocess
from collections.abc import Sequence
from datetime import date
from functools import cache
from pathlib import Path
from typing import TypeVar

import numpy as np
import pytest

T = TypeVar("T")
#: Variable of the environment of all processes of tests, set by `--verification-rows`.
ALL = "ALL_SLOW_TESTS"


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


def with_every_other_commit(name: str) -> pytest.MarkDecorator:
    """Mark of a test that takes minutes: half of those with such a mark run, others with every commit."""
    runs = ALL in os.environ or _seed(name) % 2 == 0
    return pytest.mark.skipif(not runs, reason=f"runs with every other commit, or with {ALL}=1")


def one_for_this_commit(of: Sequence[T]) -> list[T]:
    """One of some parameters of a test that takes long with each, in a list."""
    return some_for_this_commit(of, 1)


def some_for_this_commit(of: Sequence[T], count: int) -> list[T]:
    """So many of some parameters of a test that takes long with each, in their order; all of them for the table."""
    if ALL in os.environ:
        return list(of)
    return [of[number] for number in drawn_for_this_commit(len(of), count)]
