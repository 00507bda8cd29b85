"""What is tried, by name: how often, what it needs, and how a try is made of a seed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import damage.tries
import metamorphic.tries
import subsets.tries
from damage.folders_to_damage import write_whole
from damage.killing import Killed, killers


@dataclass(frozen=True)
class Tried:
    """What came of a try.

    Attributes
    ----------
    what : str
        What was done: the change, the way of killing, the damage, the case.
    ended : str
        How it ended, in a word or two that tries share.
    size : float or None
        Largest difference, where results are compared.
    defect : str
        What must not be; empty if nothing was wrong.
    """

    what: str
    ended: str
    size: float | None = None
    defect: str = ""


#: A try of a seed.
Trying = Callable[[int], Tried]


@dataclass(frozen=True)
class Kind:
    """Tries of a kind.

    Attributes
    ----------
    promised : int
        How many tries are wanted.
    prepared : callable
        Loads and writes what its tries share, in a folder; returns what makes one of a seed.
    lasts : float
        Processor seconds [s] of the longest tries: they are begun where so much time is left, and what computes for
        ten times as long and 30 s more is wrong.
    packages : tuple of str
        What it imports beside NumPy, SciPy, Warp, meshio, tomli-w and threadpoolctl.
    """

    promised: int
    prepared: Callable[[Path], Trying]
    lasts: float = 1.0
    packages: tuple[str, ...] = ()


def _damaged(place: Path) -> Trying:
    whole = write_whole(place / "whole")

    def trying(seed: int) -> Tried:
        one = damage.tries.one_try(whole, seed)
        return Tried(f"{one.file}, {one.damage}", "refused" if one.refused else "read", None, one.defect)

    return trying


def _same(kind: str, tolerance: float, _place: Path) -> Trying:
    def trying(seed: int) -> Tried:
        one = metamorphic.tries.one_try(seed, kind, tolerance=tolerance)
        return Tried(one.change, one.ended, one.size, str(one) if one.wrong else "")

    # kernels are loaded
    trying(0)
    return trying


def _killed(name: str, place: Path) -> Trying:
    kill: Callable[[int], Killed] = killers(place, (name,))[name]

    def trying(seed: int) -> Tried:
        one = kill(seed)
        return Tried(one.way, "ended" if one.status >= 0 else "killed", None, one.defect)

    return trying


def _subset(_place: Path) -> Trying:
    every = subsets.tries.every_subset()

    def trying(seed: int) -> Tried:
        one = subsets.tries.one_try(*every[seed % len(every)])
        what = f"{one.case} --tissue {one.tissue}, {', '.join(one.recordings) or 'no recordings'}"
        return Tried(what, one.verdict or "a sentence", None, one.defect)

    return trying


_TOLERANCE = metamorphic.tries.TOLERANCE
_FIGURES = ("matplotlib",)

KINDS = {
    "subsets": Kind(142, _subset, 150.0, _FIGURES),
    "same-run": Kind(1000, partial(_same, "run", _TOLERANCE)),
    "same-run-at-1e-8": Kind(1000, partial(_same, "run", 1e-8)),
    "same-estimate": Kind(1000, partial(_same, "estimate", _TOLERANCE), 20.0),
    "same-diagnose": Kind(1000, partial(_same, "diagnose", _TOLERANCE), 10.0),
    # of these a quarter finds the disk full, the others are killed
    **{
        f"kill-{name}": Kind(280, partial(_killed, name), lasts, _FIGURES)
        for name, lasts in (("run", 1.0), ("ensemble", 1.0), ("estimate", 5.0), ("sweep", 1.0), ("diagnose", 10.0))
    },
    "kill-cases-build": Kind(280, partial(_killed, "cases build")),
    "damage": Kind(10_000, _damaged, packages=("h5py", "nibabel")),
}
