"""A diagnosis as lines of text, made from its JSON."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

from warpbrain.inference.decide import NOTHING
from warpbrain.inference.probability import percent
from warpbrain.physics.words import measured
from warpbrain.report.diagnosis.description import STATES
from warpbrain.report.files import MILLIMETRES

_WIDTH = 110
#: Times at which a size that changes is said; sets of causes and measurements that are.
_TIMES, _SETS, _NEXT = 5, 6, 5


def diagnosis_lines(said: Mapping[str, Any]) -> list[str]:
    """The verdict on top, then sets of causes, each cause, the fit and what to do next."""
    return [*_verdict(said), "", *_sets(said), "", *_causes(said), "", *_fit(said), *_further(said)]


def _wrapped(sentence: str, following: str = "  ") -> list[str]:
    return textwrap.wrap(sentence, _WIDTH, initial_indent="  ", subsequent_indent=following)


def _verdict(said: Mapping[str, Any]) -> Iterator[str]:
    yield f"VERDICT: {said['verdict']}"
    yield from _wrapped(said["sentence"])
    if said["where"] is not None:
        yield f"  where: {where_in_words(said['where'])}"
    if said["when"] is not None:
        yield f"  when: {when_in_words(said['when'])}"


def where_in_words(where: Mapping[str, Any]) -> str:
    """Where a mismatch is largest: a place in a body, or a part of a test."""
    if "test" in where:
        low, high = where["strain"]
        part = f"{where['test']} ({where['mode']}), {where['segment']}"
        return f"most in {part}, at stretches or shears from {low:.3g} to {high:.3g}"
    x, y, z = (MILLIMETRES * value for value in where["centre_m"])
    within = f"within {MILLIMETRES * where['radius_m']:.1f} mm"
    return f"({x:z.1f}, {y:z.1f}, {z:z.1f}) mm in RAS, {within}; p = {where['global_p']:.2g} looking everywhere"


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
    chosen = sorted({round(k * (len(rows) - 1) / (_TIMES - 1)) for k in range(_TIMES)})
    each = (f"{measured(value, sd, sizes['unit'])} at {time:.3g} s" for time, value, sd in (rows[k] for k in chosen))
    return f"it changes with time: {sizes['says']} {', '.join(each)}"


def sets_of(said: Mapping[str, Any]) -> list[tuple[str, str, float]]:
    """The most probable sets of causes: which, with what probability, and the log evidence against nothing."""
    sets = said["combinations"] if "combinations" in said else said["hypotheses"]
    nothing = next((one["log_evidence"] for one in sets if not one["causes"]), None)
    against = 0.0 if "combinations" in said else nothing
    return [
        (" and ".join(one["causes"]) or "nothing", percent(one["probability"]), one["log_evidence"] - against)
        for one in sets[:_SETS]
        if against is not None
    ]


def _sets(said: Mapping[str, Any]) -> Iterator[str]:
    yield f"  p = {said['p_value']:.2g} that nothing is missing; the most probable sets of causes:"
    for causes, probability, evidence in sets_of(said):
        yield f"    {causes:<60} {probability:>10}   log evidence {evidence:+8.1f}"
    if said["p_left"] is not None:
        yield f"  p = {said['p_left']:.2g} that nothing is left beside the causes that the verdict is about"


def _causes(said: Mapping[str, Any]) -> Iterator[str]:
    suffix, factor, unit = unit_of(said)
    yield "  candidate          probability   log evidence        d    held-out RMSE    estimate"
    for one in said["ranking"]:
        if one["log_evidence"] is None:
            continue
        change = one["heldout_rmse_change" if suffix == "m" else "heldout_rmse_change_pa"]
        held = f"{factor * change:+8.3g} {unit}" if change is not None else " " * 11
        estimate = ", ".join(
            f"{name} {value['value']:.3g} ± {value['sd']:.2g} {value['unit']}".rstrip()
            for name, value in list(one["estimate"].items())[:3]
        )
        d = f"{one['detectability']:8.1f}" if one["physics"] and one["detectability"] is not None else " " * 8
        numbers = f"{percent(one['probability']):>11} {one['log_evidence']:14.1f} {d}   {held}"
        yield f"  {one['mechanism']:<18} {numbers}      {estimate}".rstrip()
    rejected = [one for one in said["ranking"] if one["log_evidence"] is None]
    if rejected:
        yield from ["", "  not tried:"]
        yield from (f"    {one['mechanism']}: {one['rejected_because']}" for one in rejected)


def unit_of(said: Mapping[str, Any]) -> tuple[str, float, str]:
    """Of errors: how keys of `diagnosis.json` end, a factor to what is shown, and its unit."""
    return ("m", MILLIMETRES, "mm") if "rmse_m" in said["fit"] else ("pa", 1.0, "Pa")


def _fit(said: Mapping[str, Any]) -> Iterator[str]:
    suffix, factor, unit = unit_of(said)
    fit = said["fit"]
    inside, outside, check = (fit[f"{key}_{suffix}"] or {} for key in ("rmse", "heldout_rmse", "check_rmse"))
    yield f"  {f'RMSE [{unit}]':<28}   fitted   held out   {'check' if any(check.values()) else ''}".rstrip()
    for key, name in STATES.items():
        if inside[key] is not None:
            held = " " * 8 if outside[key] is None else f"{factor * outside[key]:8.4g}"
            seen = check.get(key)
            tests = seen if isinstance(seen, dict) else {} if seen is None else {"": seen}
            checks = ", ".join(f"{test} {factor * value:.4g}".strip() for test, value in tests.items())
            yield f"  {name:<28} {factor * inside[key]:8.4g}   {held}   {checks}".rstrip()
    if fit.get("ceiling_heldout_rmse_m") is not None:
        yield f"  {'any smooth force (ceiling)':<28} {'':8}   {factor * fit['ceiling_heldout_rmse_m']:8.4g}"
    if fit["improvement"] is not None:
        low, high = fit["improvement"]["interval_95"]
        yield (
            f"  held-out error falls by {100 * fit['improvement']['part']:.0f} % (95 %: {100 * low:.0f} to "
            f"{100 * high:.0f} %)"
        )
    for one in fit["confirmations"]:
        yield (
            f"  without {one['mechanism']}: log evidence {-one['log_evidence']:+.1f}, of held-out rows "
            f"{-one['heldout_log_density']:+.1f}; a pattern that means nothing does as well with "
            f"p = {one['placebo_p']:.2g}"
        )


def _further(said: Mapping[str, Any]) -> Iterator[str]:
    if said["verdict"] != NOTHING and said["smallest_detectable"]:
        shown = "; ".join(f"{kind} {one['says']}" for kind, one in said["smallest_detectable"].items())
        yield from ["", *_wrapped(f"What these data would have shown: {shown}.", "    ")]
    if said["next_measurement"]:
        yield from ["", "  what to measure next (expected log Bayes factor between the two most probable mechanisms):"]
        yield from (f"    {one['expected_nats']:8.1f}  {one['what']}" for one in said["next_measurement"][:_NEXT])
    if said.get("confusion"):
        yield ""
        for sentence in said["confusion"]["says"]:
            yield from _wrapped(sentence, "    ")
