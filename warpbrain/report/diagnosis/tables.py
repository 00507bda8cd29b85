"""The tables of a diagnosis, as HTML."""

from __future__ import annotations

from typing import Any

import numpy as np

from warpbrain.inference.probability import percent
from warpbrain.physics.sizes import size_in_words
from warpbrain.physics.values import Value
from warpbrain.report.diagnosis.saved import STATES, Rows, unit_of
from warpbrain.report.page.document import text
from warpbrain.report.page.tables import table


def candidates_table(summary: dict[str, Any]) -> str:
    """Every candidate that was tried, the most probable first."""
    unit = unit_of(summary)
    change = "heldout_rmse_change" + ("" if unit.suffix == "m" else "_pa")
    rows = []
    for one in summary["ranking"]:
        if one["log_evidence"] is None:
            continue
        held = one.get(change)
        seen = one["detectability"]
        rows.append(
            [
                f"<b>{text(one['mechanism'])}</b>",
                percent(one["probability"]),
                f"{one['log_evidence']:+.1f}",
                f"{seen:.1f}" if one["physics"] and seen is not None else "",
                "" if held is None else f"{unit.factor * held:+.2g} {unit.name}",
                text(estimate_of(one)),
                text(one["rejected_because"]),
            ]
        )
    head = ("candidate", "probability", "log evidence", "d", "held-out error", "what it says", "why it is behind")
    return table(head, rows, numbers=(1, 2, 3, 4))


def estimate_of(one: dict[str, Any]) -> str:
    """What a candidate says: its sentence, else its numbers."""
    if "says" in one:
        return str(one["says"])
    values = [Value(name, v["value"], v["sd"], v["unit"]) for name, v in one["estimate"].items()]
    return "; ".join(size_in_words(one["mechanism"], values))


def rejected_table(summary: dict[str, Any]) -> str:
    """What was not tried, and why; empty if everything was."""
    rows = [
        [text(one["mechanism"]), text(one["rejected_because"])]
        for one in summary["ranking"]
        if one["log_evidence"] is None
    ]
    return table(("not tried", "why"), rows) if rows else ""


def fit_table(summary: dict[str, Any]) -> str:
    """Errors of each state, at what was fitted, held out, and only checked; beside them what others would reach."""
    unit, fit = unit_of(summary), summary["fit"]

    def of(key: str) -> Any:
        return fit.get(f"{key}_{unit.suffix}")

    rows = [
        [name, *(_error((of(key) or {}).get(state), unit.factor) for key in ("rmse", "heldout_rmse", "check_rmse"))]
        for state, name in STATES.items()
        if of("rmse").get(state) is not None
    ]
    if of("ceiling_heldout_rmse") is not None:
        rows.append(["any smooth force without a name", "", _error(of("ceiling_heldout_rmse"), unit.factor), ""])
    if of("placebo_heldout_rmse") is not None:
        low, high = (_error(value, unit.factor) for value in of("placebo_heldout_rmse"))
        rows.append(["nine of ten patterns that mean nothing, with as many parameters", "", f"{low} to {high}", ""])
    if of("noise_rmse") is not None:
        rows.append(["what noise alone leaves", _error(of("noise_rmse"), unit.factor), "", ""])
    head = ("", f"fitted [{unit.name}]", f"held out [{unit.name}]", f"check [{unit.name}]")
    return table(head, rows, numbers=(1, 2, 3), caption=f"Root mean square {unit.error}")


def _error(value: Any, factor: float) -> str:
    if value is None:
        return ""
    if isinstance(value, dict):
        return ", ".join(f"{text(name)} {factor * one:.3g}" for name, one in value.items())
    return f"{factor * value:.3g}"


def next_table(summary: dict[str, Any]) -> str:
    """What to measure next, the most telling first."""
    rows = [[text(one["what"]), f"{one['expected_nats']:.1f}"] for one in summary["next_measurement"]]
    return table(("measurement", "expected log Bayes factor"), rows, numbers=(1,))


def smallest_table(summary: dict[str, Any]) -> str:
    """What these data would have shown of each mechanism."""
    rows = []
    for kind, one in summary["smallest_detectable"].items():
        size = "" if one["size"] is None else f"{one['parameter']} {one['size']:.2g} {one['unit']}"
        named = one.get("named_from")
        # of what is there or not there is no size
        of_size = named is not None and one["unit"] != "of being there"
        rows.append([text(kind), text(one.get("says", size)), text(f"{named:.2g} {one['unit']}") if of_size else ""])
    return table(("mechanism", "is seen", "half are named from"), rows)


def aside_table(rows: Rows | None) -> str:
    """Points that were set aside as gross errors, with their places; empty if there are none."""
    if rows is None:
        return ""
    aside = rows["set_aside"] > 0.0
    found = []
    for point in np.unique(rows["point"][aside]):
        first = int(np.flatnonzero(rows["point"] == point)[0])
        where = ", ".join(f"{rows[f'{axis}_mm'][first]:.1f}" for axis in "xyz")
        found.append([text(rows["recording"][first]), f"{point:.0f}", where])
    if not found:
        return ""
    return table(
        ("recording", "point", "place, RAS [mm]"), found, caption="Set aside: they contradict what surrounds them"
    )
