"""A diagnosis of a specimen as JSON and as lines of text: the keys of `diagnosis.json`, stresses for lengths."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from typing import Any

from warpbrain.diagnosis.options import DiagnosisOptions
from warpbrain.diagnosis.result import Ranked
from warpbrain.diagnosis.specimen.result import Score, SpecimenDiagnosis
from warpbrain.diagnosis.specimen.stage import Stage
from warpbrain.report.fingerprints import fingerprints
from warpbrain.report.summary import machine

_WIDTH = 110


def describe_specimen_diagnosis(found: SpecimenDiagnosis, options: DiagnosisOptions, device: str) -> dict[str, Any]:
    """Everything that is known of a diagnosis; stresses in Pa, other units beside the values."""
    best = found.named[0] if found.named else None
    where = found.where
    return {
        "verdict": found.verdict,
        "sentence": found.sentence,
        "p_value": found.p_value,
        "mechanism": best.kind if best else None,
        "named": [_ranked(one) for one in found.named],
        "probability": best.probability if best else (found.ranking[0].probability if found.ranking else None),
        "parameters": _values(best) if best else {},
        "where": None
        if where is None
        else {"test": where.test, "mode": where.mode, "segment": where.segment, "strain": list(where.strain)},
        "when": None if where is None or where.time is None else {"seconds": list(where.time)},
        "ranking": [_ranked(one) for one in found.ranking]
        + [_rejected(kind, why) for kind, why in found.rejected.items()],
        "stages": [_stage(one) for one in found.stages],
        "group": list(found.group),
        "next_measurement": [{"what": m.what, "expected_nats": m.expected_nats} for m in found.next_measurement],
        "smallest_detectable": {
            kind: {"size": one.size, "unit": one.unit, "parameter": one.name} for kind, one in found.smallest.items()
        },
        "fit": _fit(found),
        "tests": [
            {"name": test.name, "mode": test.mode, "specimen": test.specimen, "role": "fit" if test.fitted else "check",
             "rows": len(test.strain), "largest_stress_pa": test.peak, "pa_per_unit": test.unit}
            for test in found.protocol.tests
        ],
        "assumptions": list(found.assumptions),
        "remarks": list(found.remarks),
        "case": {"name": found.case.name, "title": found.case.title, "origin": found.case.origin},
        "inputs_sha256": fingerprints(found.case),
        "options": {
            "candidates": "all" if options.candidates is None else list(options.candidates),
            "alpha": options.alpha,
            "seed": options.seed,
            "draws": options.draws,
            "ends": options.ends,
        },
        "seconds": found.seconds,
        "device": device,
        "versions": machine(),
    }  # fmt: skip


def _values(one: Ranked) -> dict[str, Any]:
    return {value.name: {"value": value.value, "sd": value.sd, "unit": value.unit} for value in one.values}


def _ranked(one: Ranked) -> dict[str, Any]:
    return {
        "mechanism": one.kind,
        "physics": one.physics,
        "log_evidence": one.log_evidence,
        "probability": one.probability,
        "heldout_rmse_change_pa": one.heldout_rmse_change,
        "detectability": one.detectability,
        "estimate": _values(one),
        "region": one.region,
        "rejected_because": one.rejected_because,
    }


def _rejected(kind: str, why: str) -> dict[str, Any]:
    return {
        "mechanism": kind,
        "physics": True,
        "log_evidence": None,
        "probability": 0.0,
        "heldout_rmse_change_pa": None,
        "detectability": None,
        "estimate": {},
        "region": "",
        "rejected_because": why,
    }


def _stage(stage: Stage) -> dict[str, Any]:
    return {
        "with": list(stage.without.hypothesis.kinds),
        "p_value": stage.p_value,
        "noise_scale": stage.without.kappa,
        "heldout_error_relative": stage.predicted.rmse,
        "candidates": [
            {
                "mechanism": one.kind,
                "log_evidence": one.log_evidence,
                "probability": one.probability,
                "heldout_error_relative": None if one.predicted is None else one.predicted.rmse,
            }
            for one in stage.candidates
        ],
        "added": None if stage.accepted is None else stage.accepted.kind,
        "why_not": stage.why,
    }


def _fit(found: SpecimenDiagnosis) -> dict[str, Any]:
    names = ("declared", "refitted", "explained")
    scores: dict[str, Score | None] = {name: found.scores.get(name) for name in names}
    gain = found.improvement
    return {
        "rmse_pa": {name: one.fitted if one else None for name, one in scores.items()},
        "heldout_rmse_pa": {name: one.heldout if one else None for name, one in scores.items()},
        "check_rmse_pa": {name: one.check if one else None for name, one in scores.items()},
        "held_out": "each test in turn" if found.by_test else "each quarter of the only test in turn",
        "improvement": None if gain is None else {"part": gain[0], "interval_95": list(gain[1:])},
        "confirmations": [
            {
                "mechanism": one.kind,
                "log_evidence": one.log_evidence,
                "heldout_gain": {"part": one.gain[0], "interval_95": list(one.gain[1:])},
                "placebo_p": one.placebo_p,
                "why_not": one.why_not,
            }
            for one in found.confirmations
        ],
    }


def specimen_diagnosis_lines(said: Mapping[str, Any]) -> list[str]:
    """The verdict on top, then every stage, the fit and what to do next."""
    lines = [f"VERDICT: {said['verdict']}"]
    lines += textwrap.wrap(said["sentence"], _WIDTH, initial_indent="  ", subsequent_indent="  ")
    where = said["where"]
    if where is not None:
        low, high = where["strain"]
        lines.append(f"  shows most in: {where['test']} ({where['mode']}), {where['segment']}, {low:.3g} to {high:.3g}")
    for stage in said["stages"]:
        assumed = " and ".join(stage["with"]) or "nothing added"
        lines += ["", f"  with {assumed}: p = {stage['p_value']:.2g} that nothing is left"]
        for one in stage["candidates"][:5]:
            held = one["heldout_error_relative"]
            lines.append(
                f"    {one['mechanism']:<20} probability {one['probability']:6.3f}   log evidence "
                f"{one['log_evidence']:+8.1f}"
                + ("" if held is None else f"   held-out error {100 * held:6.2f} % of peak")
            )
        if stage["why_not"]:
            lines.append(f"    not named: {stage['why_not']}")
    fit = said["fit"]
    for one in fit["confirmations"]:
        part, (low, high) = one["heldout_gain"]["part"], one["heldout_gain"]["interval_95"]
        lines += ["", f"  without {one['mechanism']} of all that was added:"]
        lines.append(
            f"    log evidence {-one['log_evidence']:+.1f}; it takes {100 * part:.0f} % off the held-out error "
            f"(95 %: {100 * low:.0f} to {100 * high:.0f} %), a placebo as much with p = {one['placebo_p']:.2g}"
        )
        if one["why_not"]:
            lines.append(f"    not named: {one['why_not']}")
    rejected = [one for one in said["ranking"] if one["log_evidence"] is None]
    if rejected:
        lines += ["", "  not tried:"]
        lines += [f"    {one['mechanism']}: {one['rejected_because']}" for one in rejected]
    lines += ["", "  RMSE [Pa]                      fitted   held out   check"]
    for key, name in (
        ("declared", "as declared"),
        ("refitted", "tissue refitted"),
        ("explained", "with what was added"),
    ):
        inside, outside, check = fit["rmse_pa"][key], fit["heldout_rmse_pa"][key], fit["check_rmse_pa"][key]
        if inside is not None:
            held = f"{outside:10.4g}" if outside is not None else " " * 10
            checks = ", ".join(f"{name} {value:.4g}" for name, value in (check or {}).items())
            lines.append(f"  {name:<27} {inside:9.4g} {held}   {checks}".rstrip())
    if said["next_measurement"]:
        lines += ["", "  what to measure next (expected nats between the two most probable mechanisms):"]
        lines += [f"    {one['expected_nats']:8.1f}  {one['what']}" for one in said["next_measurement"][:4]]
    return lines
