"""A diagnosis as lines of text, made from its JSON."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from typing import Any

from warpbrain.inference.decide import NOTHING
from warpbrain.inference.probability import percent
from warpbrain.physics.words import measured
from warpbrain.report.diagnosis.saved import STATES
from warpbrain.report.files import MILLIMETRES

_WIDTH = 110
#: Times at which a size that changes is said.
_SHOWN = 5


def diagnosis_lines(summary: Mapping[str, Any]) -> list[str]:
    """The verdict on top, then the candidates, the fit and what to do next."""
    lines = [
        f"VERDICT: {summary['verdict']}",
        *textwrap.wrap(summary["sentence"], _WIDTH, initial_indent="  ", subsequent_indent="  "),
    ]
    where = summary["where"]
    if where is not None:
        x, y, z = (MILLIMETRES * value for value in where["centre_m"])
        lines.append(
            f"  where: ({x:.1f}, {y:.1f}, {z:.1f}) mm, within {MILLIMETRES * where['radius_m']:.1f} mm; "
            f"p = {where['global_p']:.2g} looking everywhere"
        )
    if summary["when"] is not None:
        lines.append(f"  when: {when_in_words(summary['when'])}")
    lines += ["", "  candidate          probability   log evidence        d    held-out RMSE    estimate"]
    lines += [_line(one) for one in summary["ranking"] if one["log_evidence"] is not None]
    rejected = [one for one in summary["ranking"] if one["log_evidence"] is None]
    if rejected:
        lines += ["", "  not tried:"]
        lines += [f"    {one['mechanism']}: {one['rejected_because']}" for one in rejected]
    lines += ["", *_fit_lines(summary["fit"])]
    if summary["verdict"] != NOTHING and summary["smallest_detectable"]:
        shown = "; ".join(f"{kind} {one['says']}" for kind, one in summary["smallest_detectable"].items())
        shown = f"What these data would have shown: {shown}."
        lines += ["", *textwrap.wrap(shown, _WIDTH, initial_indent="  ", subsequent_indent="    ")]
    if summary["next_measurement"]:
        lines += ["", "  what to measure next (expected log Bayes factor between the two most probable mechanisms):"]
        lines += [f"    {one['expected_nats']:8.1f}  {one['what']}" for one in summary["next_measurement"][:5]]
    if summary["confusion"]:
        lines.append("")
        for sentence in summary["confusion"]["says"]:
            lines += textwrap.wrap(sentence, _WIDTH, initial_indent="  ", subsequent_indent="    ")
    return lines


def when_in_words(when: Mapping[str, Any]) -> str:
    """When something set in, how surely, and how it came."""
    first, last = when["seconds"]
    if "course" not in when:
        # of a laboratory test it is the part of the record
        return f"{first:.3g} to {last:.3g} s"
    if when.get("sizes") is not None:
        return _sizes_in_words(when["sizes"])
    between = f"by {last:.3g} s" if first == 0.0 else f"between {first:.3g} and {last:.3g} s"
    sure = "" if when["probability"] is None else f" (probability {percent(when['probability'])})"
    course = f", {when['course']}" if when["course"] else ""
    return f"it set in {between}{sure}{course}"


def _sizes_in_words(sizes: Mapping[str, Any]) -> str:
    """A size over time: at the first and the last time, and at a few between."""
    rows = list(zip(sizes["seconds"], sizes["values"], sizes["deviations"], strict=True))
    chosen = sorted({round(k * (len(rows) - 1) / (_SHOWN - 1)) for k in range(_SHOWN)})
    each = (f"{measured(value, sd, sizes['unit'])} at {time:.3g} s" for time, value, sd in (rows[k] for k in chosen))
    return f"it changes with time: {sizes['says']} {', '.join(each)}"


def _line(one: Mapping[str, Any]) -> str:
    change = one["heldout_rmse_change"]
    held = f"{MILLIMETRES * change:+8.3f} mm" if change is not None else " " * 11
    estimate = ", ".join(
        f"{name} {value['value']:.3g} ± {value['sd']:.2g} {value['unit']}".rstrip()
        for name, value in list(one["estimate"].items())[:3]
    )
    d = f"{one['detectability']:8.1f}" if one["physics"] else " " * 8
    numbers = f"{percent(one['probability']):>11} {one['log_evidence']:14.1f} {d}   {held}"
    return f"  {one['mechanism']:<18} {numbers}      {estimate}".rstrip()


def _fit_lines(fit: Mapping[str, Any]) -> list[str]:
    lines = ["  RMSE [mm]                      fitted   held out"]
    for key, name in STATES.items():
        inside, outside = fit["rmse_m"][key], fit["heldout_rmse_m"][key]
        if inside is not None:
            lines.append(f"  {name:<28} {MILLIMETRES * inside:8.3f}   {MILLIMETRES * outside:8.3f}")
    lines.append(f"  {'any smooth force (ceiling)':<28} {'':8}   {MILLIMETRES * fit['ceiling_heldout_rmse_m']:8.3f}")
    if fit["improvement"] is not None:
        low, high = fit["improvement"]["interval_95"]
        lines.append(
            f"  held-out error falls by {100 * fit['improvement']['part']:.0f} % (95 %: {100 * low:.0f} to "
            f"{100 * high:.0f} %); a pattern that means nothing does as well with p = {fit['placebo_p']:.2g}"
        )
    return lines
