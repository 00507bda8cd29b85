"""In words: whether a state explains its recordings better or worse than nothing at all would."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from warpbrain.physics.words import tabled

#: What "before" is, by the unit of an error: nothing moves, or nothing pushes.
_NOTHING = {"mm": "no motion", "N": "no force", "Pa": "no stress"}
WORSE, IN_PART, NO_NEARER, NEARER, UNKNOWN = (
    "worse than no motion at all", "in part worse than no motion", "no nearer than no motion", "nearer than no motion",
    "not compared",
)  # fmt: skip


@dataclass(frozen=True)
class Explained:
    """How a state compares with doing nothing.

    Attributes
    ----------
    verdict : str
        One of `WORSE`, `IN_PART`, `NO_NEARER`, `NEARER` and `UNKNOWN`, of lengths; of other units alone, `UNKNOWN`.
    before, after : float or None
        Root mean square over all rows in mm, with nothing moved and with the state.
    sentences : tuple of str
        Of all lengths together, and of each recording to which nothing is nearer than the state.
    """

    verdict: str
    before: float | None
    after: float | None
    sentences: tuple[str, ...]


def explained(entries: Sequence[Mapping[str, Any]], what: str = "this simulation") -> Explained:
    """Judge a state by its comparisons.

    Parameters
    ----------
    entries : sequence of mapping
        ``name``, ``unit``, ``count``, and root mean squares ``before`` and ``after`` in that unit, of each recording.
    what : str
        What is judged, as the sentences call it.
    """
    lengths = [one for one in entries if one["unit"] == "mm" and one["count"]]
    before, after = (_together(lengths, key) for key in ("before", "after"))
    sentences = []
    if before is not None and after is not None:
        sentences.append(_overall(before, after, what))
    worse = [one for one in entries if one["after"] > one["before"]]
    sentences += [
        f"It explains '{one['name']}' worse than {_NOTHING.get(one['unit'], 'nothing')} at all: RMSE "
        f"{number(one['after'], one['unit'])} {one['unit']} with it, {number(one['before'], one['unit'])} "
        f"{one['unit']} without."
        for one in worse
    ]
    verdict = NEARER
    if before is None or after is None:
        verdict = UNKNOWN
    elif after > before:
        verdict = WORSE
    elif worse:
        verdict = IN_PART
    elif not _percent_gone(before, after):
        verdict = NO_NEARER
    return Explained(verdict, before, after, tuple(sentences))


def number(value: float, unit: str) -> str:
    """An error as people read it: micrometres of lengths, three digits of what has any size."""
    return tabled(value) if unit == "mm" else f"{value:.3g}"


def _together(entries: Sequence[Mapping[str, Any]], key: str) -> float | None:
    count = sum(one["count"] for one in entries)
    return math.sqrt(sum(one["count"] * one[key] ** 2 for one in entries) / count) if count else None


def _overall(before: float, after: float, what: str) -> str:
    name = what[0].upper() + what[1:]
    if after > before:
        return (
            f"{name} explains the recordings worse than no motion at all: RMSE {tabled(after)} mm with it, "
            f"{tabled(before)} mm if nothing had moved."
        )
    gone = _percent_gone(before, after)
    if not gone:
        return (
            f"{name} explains the recordings no better than no motion at all: RMSE {tabled(after)} mm with it and "
            "without."
        )
    return (
        f"{name} takes {gone} % off the error of no motion at all: RMSE {tabled(before)} mm if nothing had moved, "
        f"{tabled(after)} mm with it."
    )


def _percent_gone(before: float, after: float) -> int:
    """How much of an error is gone, in whole per cent."""
    return round(100.0 * (1.0 - after / before)) if before > 0.0 else 0
