"""Which cases a set has."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from referee.draw import MECHANISMS, OUTSIDE, TRAPS

#: Sets, and how many cases each has if nobody says.
SETS = {
    "development": 24,
    "calibration": 80,
    "scored": 160,
    "traps": 60,
    "pairs": 100,
    "unknown": 100,
    "challenge": 500,
}
#: Shares of cases; all others have one mechanism each, in turn.
SHARES = {
    "scored": {"none": 0.2, "two": 0.1, "outside": 0.05, "trap": 0.05},
    "calibration": {"none": 0.375, "two": 0.075, "outside": 0.075, "trap": 0.075},
    "traps": {"trap": 1.0},
    "pairs": {"two": 1.0},
    "unknown": {"outside": 1.0},
    "challenge": {"none": 0.12, "two": 0.2, "outside": 0.2, "trap": 0.16},
}
#: Least detectability of each of two effects at once.
BOTH = 5.0


@dataclass(frozen=True)
class Planned:
    """A case before anything is drawn.

    Attributes
    ----------
    kind : {"none", "effect", "two", "outside", "trap"}
    names : tuple of str
        Of effects, or of the trap.
    geometry : str
    """

    kind: str
    names: tuple[str, ...]
    geometry: str


def planned(which: str, count: int, geometries: Sequence[str], seed: int) -> list[Planned]:
    """The cases of a set, in an order that says nothing.

    Parameters
    ----------
    which : str
        A name in `SETS`.
    count : int
        The scored set of 160 has 32 cases in which nothing is missing, 12 of each mechanism, 16 of two at once, 8
        outside the dictionary and 8 traps; calibration of 80 has 30, 4 of each, 6, 6 and 6; any other number has the
        same shares. Traps, pairs (two at once) and unknown (outside the dictionary) have nothing else, of each as
        many. The challenge of 500 has 60, 20 of each, 100, 100 and 80. Development takes one of everything in turn.
    geometries : sequence of str
        In turn.
    seed : int
        Of the order, and of which two act at once.
    """
    random = np.random.default_rng([seed, count])
    pairs = list(itertools.combinations(MECHANISMS, 2))
    two = [pairs[k] for k in random.permutation(len(pairs))]
    chosen = _development(count, two) if which == "development" else _shared(count, SHARES[which], two)
    # each kind meets every geometry
    of_kind: dict[tuple[str, ...], int] = {}
    cases = []
    for kind, names in chosen:
        key = (kind, *names) if kind in ("effect", "trap") else (kind,)
        turn_of = of_kind.get(key, len(of_kind))
        of_kind[key] = turn_of + 1
        geometry = geometries[turn_of % len(geometries)]
        if names == ("coarse",):
            geometry = "phantom"
        cases.append(Planned(kind, names, geometry))
    return [cases[k] for k in random.permutation(len(cases))]


Chosen = list[tuple[str, tuple[str, ...]]]


def _development(count: int, two: list[tuple[str, str]]) -> Chosen:
    once: Chosen = [("none", ())]
    once += [("effect", (name,)) for name in MECHANISMS[:4]] + [("none", ())]
    once += [("effect", (name,)) for name in MECHANISMS[4:]] + [("none", ()), ("two", two[0])]
    once += [("outside", (OUTSIDE[0],)), ("trap", (TRAPS[0],)), ("effect", ("inclusion",)), ("effect", ("contact",))]
    once += [("outside", (OUTSIDE[1],)), ("trap", (TRAPS[4],))]
    once += [("outside", (name,)) for name in OUTSIDE[3:]] + [("two", two[1]), ("two", two[2])]
    return [once[k % len(once)] for k in range(count)]


def _shared(count: int, shares: dict[str, float], two: list[tuple[str, str]]) -> Chosen:
    of_kind: dict[str, list[tuple[str, ...]]] = {
        "none": [()],
        "two": list(two),
        "outside": [(name,) for name in OUTSIDE],
        "trap": [(name,) for name in TRAPS],
    }
    rows: Chosen = []
    for kind, part in shares.items():
        names = of_kind[kind]
        rows += [(kind, names[k % len(names)]) for k in range(round(part * count))]
    rest = count - len(rows)
    return rows + [("effect", (MECHANISMS[k % len(MECHANISMS)],)) for k in range(rest)]
