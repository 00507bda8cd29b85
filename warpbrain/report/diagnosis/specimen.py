"""A diagnosis of a specimen as JSON, with stresses for lengths, as lines of text and as curves."""

from __future__ import annotations

import math
import textwrap
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.atomic import whole_file
from warpbrain.inference.causes import Kind
from warpbrain.inference.probability import percent
from warpbrain.report.diagnosis.common import describe_cause, describe_common, describe_decision, describe_values
from warpbrain.report.diagnosis.saved import STATES
from warpbrain.worlds.specimen.diagnose import SpecimenOptions
from warpbrain.worlds.specimen.result import Ranked, SpecimenDiagnosis
from warpbrain.worlds.specimen.sentences import sentence_of

_WIDTH = 110


def describe_specimen_diagnosis(found: SpecimenDiagnosis, options: SpecimenOptions, device: str) -> dict[str, Any]:
    """Everything that is known of a diagnosis; stresses in Pa, other units beside the values."""
    where = found.where
    particular = {
        "mechanisms": [_ranked(one) for one in found.named],
        "where": None
        if where is None
        else {"test": where.test, "mode": where.mode, "segment": where.segment, "strain": list(where.strain)},
        "when": None if where is None or where.time is None else {"seconds": list(where.time)},
        "ranking": [_ranked(one) for one in found.ranking]
        + [describe_cause(name, why, heldout_rmse_change_pa=None) for name, why in found.rejected.items()],
        "combinations": [asdict(one) for one in found.combinations],
        "before_checks": describe_decision(found.by_posterior),
        "smallest_detectable": {
            name: {"size": one.size, "unit": one.unit, "parameter": one.name} for name, one in found.smallest.items()
        },
        "fit": _fit(found, options.alpha),
        "tests": [
            {"name": test.name, "mode": test.mode, "specimen": test.specimen, "role": "fit" if test.fitted else "check",
             "rows": len(test.strain), "largest_stress_pa": test.peak, "pa_per_unit": test.unit}
            for test in found.protocol.tests
        ],
    }  # fmt: skip
    names = [one.name for one in found.named]
    return describe_common(found, sentence_of(found), names, asdict(options), device, particular)


def _ranked(one: Ranked) -> dict[str, Any]:
    stands = math.isfinite(one.log_evidence)
    return describe_cause(
        one.name,
        "" if stands else "no fit with it stands",
        physics=one.kind is Kind.PHYSICS,
        log_evidence=one.log_evidence if stands else None,
        probability=one.probability,
        heldout_rmse_change_pa=one.change,
        detectability=one.detectability,
        estimate=describe_values(one.values),
        region=one.region,
    )


def _fit(found: SpecimenDiagnosis, alpha: float) -> dict[str, Any]:
    scores = {name: found.scores.get(name) for name in STATES}
    gain = found.improvement
    return {
        "rmse_pa": {name: one.fitted if one else None for name, one in scores.items()},
        "heldout_rmse_pa": {name: one.heldout if one else None for name, one in scores.items()},
        "check_rmse_pa": {name: one.check if one else None for name, one in scores.items()},
        "rows": "all that were recorded",
        "held_out": "each test in turn" if found.by_test else "each quarter of the only test in turn",
        "improvement": None if gain is None else {"part": gain[0], "interval_95": list(gain[1:])},
        "confirmations": [
            {
                "mechanism": one.name,
                "log_evidence": one.log_evidence,
                "heldout_log_density": one.heldout_log_density,
                "heldout_gain": {"part": one.gain[0], "interval_95": list(one.gain[1:])},
                "placebo_p": one.placebo_p,
                "why_not": one.why_not(alpha),
            }
            for one in found.confirmations
        ],
    }


def specimen_diagnosis_lines(found: SpecimenDiagnosis) -> list[str]:
    """The verdict on top, then sets of causes, what each is worth, the fit and what to do next."""
    lines = [f"VERDICT: {found.verdict}"]
    lines += textwrap.wrap(sentence_of(found), _WIDTH, initial_indent="  ", subsequent_indent="  ")
    if found.where is not None:
        low, high = found.where.strain
        lines.append(
            f"  shows most in: {found.where.test} ({found.where.mode}), {found.where.segment}, {low:.3g} to {high:.3g}"
        )
    lines += ["", f"  p = {found.p_value:.2g} that nothing is missing; the most probable sets of causes:"]
    for combination in found.combinations[:6]:
        causes = " and ".join(combination.causes) or "nothing"
        lines.append(
            f"    {causes:<60} {percent(combination.probability):>10}   log evidence {combination.log_evidence:+8.1f}"
        )
    if found.p_left is not None:
        lines.append(f"  with {' and '.join(found.assumed)}: p = {found.p_left:.2g} that nothing is left")
    for one in found.confirmations:
        part, low, high = (100.0 * value for value in one.gain)
        lines += [
            f"  without {one.name} of all that was added:",
            f"    log evidence {-one.log_evidence:+.1f}, of held-out rows {-one.heldout_log_density:+.1f}; it takes "
            f"{part:.0f} % off the held-out error (95 %: {low:.0f} to {high:.0f} %), a placebo as much with "
            f"p = {one.placebo_p:.2g}",
        ]
    if found.rejected:
        lines += ["", "  not tried:"]
        lines += [f"    {name}: {why}" for name, why in found.rejected.items()]
    lines += ["", "  RMSE of all rows [Pa]          fitted   held out   check"]
    for key, name in STATES.items():
        score = found.scores.get(key)
        if score is not None:
            held = " " * 10 if score.heldout is None else f"{score.heldout:10.4g}"
            checks = ", ".join(f"{test} {value:.4g}" for test, value in score.check.items())
            lines.append(f"  {name:<27} {score.fitted:9.4g} {held}   {checks}".rstrip())
    if found.next_measurement:
        lines += ["", "  what to measure next (expected log Bayes factor between the two most probable sets):"]
        lines += [f"    {one.expected_nats:8.1f}  {one.what}" for one in found.next_measurement[:4]]
    return lines


def write_curves(path: Path, found: SpecimenDiagnosis) -> None:
    """Write one row for each that was compared; times [s] are empty where there are none, stresses are nominal [Pa]."""
    names = list(found.stresses)
    simulated_names = [f"{name.replace(' ', '_')}_pa" for name in names]
    header = ["test", "mode", "role", "time_s", "strain", "recorded_pa", *simulated_names]
    lines = [",".join(header)]
    for test, rows in zip(found.protocol.tests, found.protocol.rows, strict=True):
        label = '"' + test.name.replace('"', '""') + '"'
        simulated = np.column_stack([found.stresses[name][rows] for name in names])
        for k in range(len(test.strain)):
            time = "" if test.time is None else f"{test.time[k]:.9g}"
            numbers = [f"{test.strain[k]:.9g}", f"{test.stress[k]:.9g}"]
            numbers += ["" if np.isnan(value) else f"{value:.9g}" for value in simulated[k]]
            lines.append(",".join([label, test.mode, "fit" if test.fitted else "check", time, *numbers]))
    with whole_file(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
