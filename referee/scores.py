"""The scores of the diagnosis: shares with exact intervals, each with its bar.

Where two act, `d` of each is that where the size of the other is not known.
"""

from __future__ import annotations

from collections.abc import Sequence
from operator import attrgetter
from typing import Any

import numpy as np

from referee.diagnoses import NAMING
from referee.intervals import Share, share
from referee.outcomes import Outcome
from referee.reliability import reliability

#: Bins of detectability.
BINS = ((0.0, 3.0), (3.0, 5.0), (5.0, 8.0), (8.0, np.inf))
#: What is visible, and what is plainly so.
VISIBLE, PLAIN = 5.0, 8.0
#: Bars: at most so much.
AT_MOST = {
    "false alarms": 0.05,
    "significant where nothing is missing": 0.05,
    "traps named as physics": 0.05,
    "rigid motions said to be missing physics": 0.0,
    "outside the dictionary, called by a wrong name": 0.03,
    "mechanism left out, called by a name, d >= 8": 0.1,
}
#: At least so much.
AT_LEAST = {
    "right name or group holding it, d >= 8": 0.95,
    "right name or group holding it, the tool's d >= 8": 0.95,
    "right name alone, d >= 8": 0.92,
    "right name alone, the tool's d >= 8": 0.92,
    "90 % label set holds the truth": 0.9,
    "spoken names right": 0.97,
    "centre within 10 mm": 0.5,
    "unknown found, d >= 8": 0.6,
    "both of two named, each d >= 8": 0.75,
    "both of two named, each d >= 5": 0.55,
    "both of two named, each of the tool's d >= 8": 0.75,
    "both of two named, each of the tool's d >= 5": 0.55,
}
#: Kinds of cases.
KINDS = ("none", "effect", "two", "outside", "trap", "left out")
#: Level of the tool's alarm.
ALPHA = 0.05
#: A centre is found if it is nearer than this [m].
NEAR = 0.010


def bin_name(low: float, high: float) -> str:
    """A bin for people."""
    return f"d >= {low:g}" if np.isinf(high) else f"d < {high:g}" if low == 0.0 else f"{low:g} <= d < {high:g}"


def shares(outcomes: Sequence[Outcome]) -> dict[str, Share]:
    """Every share that is scored, by name."""
    of = {kind: [o for o in outcomes if o.kind == kind] for kind in KINDS}
    effects = of["effect"]
    plain = [o for o in effects if o.d >= PLAIN]
    for_tool = [o for o in effects if o.seen is not None and o.seen >= PLAIN]
    scored = {
        "false alarms": share(o.said.alarm for o in of["none"]),
        "significant where nothing is missing": share(o.said.p_value <= ALPHA for o in of["none"]),
        "traps named as physics": share(o.said.verdict in NAMING for o in of["trap"]),
        "traps said to be unknown physics": share(o.said.verdict == "unknown" for o in of["trap"]),
        "rigid motions said to be missing physics": share(
            o.said.alarm for o in of["trap"] if o.truth == "registration"
        ),
    }
    for low, high in BINS:
        scored[f"best candidate right, {bin_name(low, high)}"] = share(o.top for o in effects if low <= o.d < high)
    others: dict[str, list[tuple[Outcome, float | None]]] = {
        "the old": [(o, o.upper) for o in effects],
        "the tool's": [(o, o.seen) for o in effects],
        "the best fit's": [(o, o.d_of_tool) for o in effects],
    }
    for measure, by in others.items():
        for low, high in BINS:
            within = (o.top for o, d in by if d is not None and low <= d < high)
            scored[f"best candidate right, {measure} {bin_name(low, high)}"] = share(within)
    scored |= {
        "right name or group holding it, d >= 8": share(o.held for o in plain),
        "right name or group holding it, the tool's d >= 8": share(o.held for o in for_tool),
        "right name alone, d >= 8": share(o.named for o in plain),
        "right name alone, the tool's d >= 8": share(o.named for o in for_tool),
        "right name alone, the old d >= 8": share(o.named for o in effects if o.upper >= PLAIN),
        "90 % label set holds the truth": share(o.covered for o in effects if o.d >= VISIBLE and o.said.alarm),
        "spoken names right": share(o.named for o in outcomes if o.said.spoken),
        "centre within 10 mm": share(e < NEAR for o in effects if o.d >= VISIBLE and (e := o.centre_error) is not None),
        "amount within 2 sd": share(a[1] for o in effects if (a := o.amount) is not None and a[1] is not None),
        "unknown found": share(o.said.verdict in ("unknown", "named + rest") for o in of["outside"] if o.d >= VISIBLE),
        "unknown found, d >= 8": share(o.said.verdict == "unknown" or o.held for o in of["outside"] if o.d >= PLAIN),
        "outside the dictionary, called by a wrong name": share(o.said.spoken and not o.named for o in of["outside"]),
        "both of two named": share(_both(o) for o in of["two"]),
        "one of two named": share(o.held for o in of["two"]),
    }
    for least in (PLAIN, VISIBLE):
        for words, given in (("d", attrgetter("given")), ("the tool's d", attrgetter("seen_given"))):
            name = f"both of two named, each {'of ' if words != 'd' else ''}{words} >= {least:g}"
            scored[name] = share(_both(o) for o in of["two"] if (d := given(o)) and min(d) >= least)
    missing = [o for o in of["left out"] if o.d >= PLAIN]
    return scored | {
        "mechanism left out, called by a name, d >= 8": share(o.said.spoken for o in missing),
        "mechanism left out, unknown or a group with it, d >= 8": share(
            o.said.verdict == "unknown" or o.held for o in missing
        ),
    }


def _both(outcome: Outcome) -> bool:
    """Whether it names both of two effects."""
    return set(outcome.label["names"]) <= outcome.said.said


def calibration(outcomes: Sequence[Outcome]) -> dict[str, dict[str, Any]]:
    """Reliability, see `referee.reliability`.

    Returns
    -------
    dict
        `all`: of every candidate that was tried in every case with an alarm; `spoken`: of names that are spoken.
    """
    rows = [(row.probability, o.holds(row)) for o in outcomes if o.said.p_value <= ALPHA for row in o.said.tried]
    spoken = [(o.said.probability, o.named) for o in outcomes if o.said.spoken and o.said.probability is not None]
    return {"all": _reliability(rows), "spoken": _reliability(spoken)}


def _reliability(pairs: Sequence[tuple[float, bool]]) -> dict[str, Any]:
    return reliability(
        np.array([p for p, _ in pairs], dtype=float), np.array([right for _, right in pairs], dtype=bool)
    )


def amounts(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Medians of what is measured: centre error, error of amounts, held-out error that is gone."""
    effects = [o for o in outcomes if o.kind == "effect" and o.d >= VISIBLE]
    centres = [e for o in effects if (e := o.centre_error) is not None]
    errors = [a[0] for o in effects if (a := o.amount) is not None]
    cuts = [c for o in effects if o.held and (c := o.cut) is not None]
    sets = [float(len(o.said.label_set)) for o in effects if o.said.alarm]
    return {
        "candidates in a 90 % label set": {**_median(sets), "mean": float(np.mean(sets)) if sets else None},
        "centre error [m]": _median(centres),
        "relative error of amount": _median(errors),
        "held-out error above noise that is gone": _median(cuts),
    }


def _median(values: Sequence[float]) -> dict[str, Any]:
    if not values:
        return {"median": None, "of": 0}
    low, middle, high = np.percentile(values, [25, 50, 75])
    return {"median": float(middle), "quartiles": [float(low), float(high)], "of": len(values)}


def confusion(outcomes: Sequence[Outcome]) -> tuple[list[str], list[str], list[list[int]]]:
    """Rows (what is true), columns (what is said) and counts."""
    rows = sorted({_true(o) for o in outcomes}, key=lambda name: (name != "nothing", name))
    columns = sorted({_answer_of(o) for o in outcomes}, key=lambda name: (name != "nothing", name))
    table = [[sum(_true(o) == row and _answer_of(o) == column for o in outcomes) for column in columns] for row in rows]
    return rows, columns, table


def _true(outcome: Outcome) -> str:
    true = outcome.truth
    names = {"none": "nothing", "two": "two at once", "trap": f"trap: {true}", "left out": f"{true}, left out"}
    return names.get(outcome.kind, true)


def _answer_of(outcome: Outcome) -> str:
    said = outcome.said
    if said.spoken:
        return " + ".join(sorted(said.names))
    return {"nothing missing": "nothing", "group": "right group" if outcome.held else "wrong group"}.get(
        said.verdict, said.verdict
    )
