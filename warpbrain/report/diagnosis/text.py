"""A diagnosis as lines of text and as rows of tables, made from its JSON."""

import math
from collections.abc import Mapping
from typing import Any

from warpbrain.inference.calibration import percent
from warpbrain.inference.decide import NOTHING
from warpbrain.physics.words import measured, number, place, seconds
from warpbrain.report.diagnosis.description import STATES
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.page import lines

#: Times at which a size that changes is said; and sets of causes that are.
_TIMES, _SETS = 5, 6
Summary = Mapping[str, Any]


def diagnosis_lines(summary: Summary) -> list[str]:
    """The verdict on top, then sets of causes, each cause, the fit and what to do next."""
    return lines("diagnosis.txt", "diagnosis", summary, shown_of(summary), NOTHING)


def shown_of(summary: Summary) -> dict[str, Any]:
    """What templates of printed lines and of the page show: rows of tables, sentences, and the unit of errors."""
    suffix, factor, unit = unit_of(summary)
    held, sets = summary["fit"][f"heldout_rmse_{suffix}"], summary.get("combinations", summary.get("hypotheses"))
    # that of a specimen is against nothing already
    nothing = summary.get("log_evidence_of_nothing", 0.0)
    smallest, named_kinds = [], {mechanism["mechanism"] for mechanism in summary["mechanisms"]}
    for kind, effect in summary["smallest_detectable"].items():
        if kind in named_kinds:
            continue
        named = effect.get("named_from")
        # of what is there or not there is no size
        of_size = named is not None and effect["unit"] != "of being there"
        smallest.append([kind, effect["says"], f"{named:.2g} {effect['unit']}" if of_size else ""])
    return {
        "unit": unit,
        # the most probable ones: which, with what probability, and the log evidence against nothing
        "sets": [
            [" and ".join(s["causes"]) or "nothing", percent(s["probability"]), f"{s['log_evidence'] - nothing:+.1f}"]
            for s in sets[:_SETS]
        ],
        "candidates": _candidate_rows(summary),
        "rejected": [[c["mechanism"], c["rejected_because"]] for c in summary["ranking"] if c["log_evidence"] is None],
        "fit": _fit_rows(summary),
        "held_out": [f"{factor * held[state]:.3g}" for state in ("refitted", "explained") if held[state] is not None],
        # what these data would have shown of each mechanism that is not named, and from which size half would be named
        "smallest": smallest,
        "measurements": [[m["what"], f"{m['expected_nats']:.1f}"] for m in summary["next_measurement"]],
        "where": summary["where"] and _where_in_words(summary["where"]),
        "when": summary["when"] and when_in_words(summary["when"]),
    }


def unit_of(summary: Summary) -> tuple[str, float, str]:
    """Of errors: how keys of `diagnosis.json` end, a factor to what is shown, and its unit."""
    return ("m", MILLIMETRES, "mm") if "rmse_m" in summary["fit"] else ("pa", 1.0, "Pa")


def _candidate_rows(summary: Summary) -> list[list[str]]:
    """Every candidate that was tried, the most probable first: name, probability, log evidence, `d`, change of the
    held-out error, what it says, why it is behind, and its first parameters with their standard deviations."""
    suffix, factor, unit = unit_of(summary)
    rows = []
    for candidate in summary["ranking"]:
        if candidate["log_evidence"] is not None:
            held = candidate["heldout_rmse_change" if suffix == "m" else "heldout_rmse_change_pa"]
            d = candidate["detectability"] if candidate["physics"] else None
            numbers = f"{candidate['log_evidence']:+.1f}", "" if d is None else f"{d:.1f}"
            change = "" if held is None else f"{factor * held:+.3g} {unit}"
            words = candidate["says"], candidate["rejected_because"]
            values = list(candidate["estimate"].items())[:3]
            estimate = ", ".join(f"{name} {_estimated(**value)}" for name, value in values)
            head = candidate["mechanism"], percent(candidate["probability"])
            rows.append([*head, *numbers, change, *words, estimate])
    return rows


def _estimated(value: float | None, sd: float | None, unit: str) -> str:
    """A number with its spread, lengths of positions in millimetres; what is not finite is null in JSON."""
    scale = MILLIMETRES if unit == "m" else 1.0
    known, spread = (math.nan if number is None else scale * number for number in (value, sd))
    return measured(known, spread, "mm" if unit == "m" else unit)


def _fit_rows(summary: Summary) -> list[list[str]]:
    """Errors of each state, at what was fitted, held out, and only checked; beside them what others would reach."""
    (suffix, factor, _), fit = unit_of(summary), summary["fit"]

    def cell(value: Any) -> str:
        if isinstance(value, dict):
            return ", ".join(f"{name} {cell(error)}" for name, error in value.items())
        return "" if value is None else f"{factor * value:.4g}"

    columns = [fit[f"{key}_{suffix}"] or {} for key in ("rmse", "heldout_rmse", "check_rmse")]
    known = (state for state in STATES if columns[0][state] is not None)
    rows = [[STATES[state], *(cell(column.get(state)) for column in columns)] for state in known]
    if fit.get("ceiling_heldout_rmse_m") is not None:
        rows.append(["any smooth force without a name", "", cell(fit["ceiling_heldout_rmse_m"]), ""])
    if fit.get("placebo_heldout_rmse_m") is not None:
        between = " to ".join(map(cell, fit["placebo_heldout_rmse_m"]))
        rows.append(["nine of ten patterns that mean nothing, with as many parameters", "", between, ""])
    if fit.get("noise_rmse_m") is not None:
        rows.append(["what noise alone leaves", cell(fit["noise_rmse_m"]), "", ""])
    return rows


def _where_in_words(where: Summary) -> str:
    """Where a mismatch is largest: a place in a body, or a part of a test."""
    if "test" in where:
        low, high = where["strain"]
        part = f"{where['test']} ({where['mode']}), {where['segment']}"
        return f"in {part}, at stretches or shears from {low:.3g} to {high:.3g}"
    # to tenths of a millimetre, or finer in small bodies
    centre = place(where["centre_m"], min(where["radius_m"], 5e-3))
    within = f"within {number(MILLIMETRES * where['radius_m'], 3)} mm"
    return f"about {centre} in RAS, {within}; p = {where['global_p']:.2g} looking everywhere"


def when_in_words(when: Summary) -> str:
    """When something set in, how surely, and how it came."""
    first, last = when["seconds"]
    if "course" not in when:
        # of a laboratory test it is the part of the record
        return f"{seconds(first)} to {seconds(last)} s"
    if (sizes := when.get("sizes")) is not None:
        # at the first and the last time, and at a few between
        rows = list(zip(sizes["seconds"], sizes["values"], sizes["deviations"], strict=True))
        chosen = [rows[k] for k in sorted({round(k * (len(rows) - 1) / (_TIMES - 1)) for k in range(_TIMES)})]
        each = (f"{measured(value, sd, sizes['unit'])} at {seconds(time)} s" for time, value, sd in chosen)
        return f"it changes with time: {sizes['says']} {', '.join(each)}"
    between = f"by {seconds(last)} s" if first == 0.0 else f"between {seconds(first)} and {seconds(last)} s"
    sure = "" if when["probability"] is None else f" (probability {percent(when['probability'])})"
    course = f", {when['course']}" if when["course"] else ""
    return f"it set in {between}{sure}{course}"
