"""What an ensemble prints and its JSON: one dictionary, from which the printed lines are made too."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from warpbrain.ensemble.results import EnsembleResult, Spread
from warpbrain.physics.words import tabled
from warpbrain.report.comparison import SHOWN
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.summary import SET_TITLES

#: Failures that are printed; all are in the table.
_SHOWN_FAILURES = 3


def describe_ensemble(result: EnsembleResult) -> dict[str, Any]:
    """Counts, failures, and the spread of displacements and errors over the samples, with units."""
    errors = {}
    for comparison in result.done[0].comparisons if result.done else ():
        factor, unit = SHOWN[comparison.unit]
        errors[comparison.name] = {
            "unit": unit,
            "before": factor * comparison.before.root_mean_square,
            "after": _numbers(result.errors[comparison.name], factor),
            "nearest_sample": result.nearest(comparison.name).outcome.number,
        }
    return {
        "samples": len(result.rows),
        "done": len(result.done),
        "failed": {str(row.outcome.number): row.outcome.reason for row in result.failed},
        "percentiles_over_samples": len(result.done),
        "time_steps": sum(row.outcome.steps for row in result.rows),
        "cg_iterations": sum(row.outcome.cg_iterations for row in result.rows),
        "mean_displacement_mm": {name: _numbers(s, MILLIMETRES) for name, s in result.displacement.items()},
        "rmse_at_recordings": errors,
        "not_compared": list(result.not_compared),
    }


def _numbers(spread: Spread, factor: float) -> dict[str, float]:
    levels = {f"p{level:02d}": factor * float(value) for level, value in spread.percentiles.items()}
    return {"mean": factor * float(spread.mean), "sd": factor * float(spread.sd), **levels}


def ensemble_lines(described: Mapping[str, Any]) -> list[str]:
    """What is printed at the end."""
    failed = described["failed"]
    lines = [f"samples: {described['done']} done, {len(failed)} failed of {described['samples']}"]
    for number, reason in list(failed.items())[:_SHOWN_FAILURES]:
        lines.append(f"  sample {number} failed: {reason}")
    if len(failed) > _SHOWN_FAILURES:
        lines.append(f"  and {len(failed) - _SHOWN_FAILURES} more, each with its reason in samples.csv")
    if failed and described["done"]:
        lines.append(
            f"  all that follows is of the {described['done']} that have an answer; those that failed are not in it, "
            "and may be the softest"
        )
    over = f"over {described['done']} samples"
    if described["mean_displacement_mm"]:
        lines += ["", f"mean displacement [mm]        mean       sd      5 %     50 %     95 %   {over}"]
    for name, s in described["mean_displacement_mm"].items():
        lines.append(f"  {SET_TITLES.get(name, name):<22}{_columns(s)}")
    if described["rmse_at_recordings"]:
        lines += [
            "",
            f"RMSE at recordings            mean       sd      5 %     50 %     95 %   before   nearest sample, {over}",
        ]
    for name, errors in described["rmse_at_recordings"].items():
        lines.append(
            f"  {name:<22}{_columns(errors['after'])}{tabled(errors['before']):>9} {errors['unit']:<3}"
            f"{errors['nearest_sample']:>8}"
        )
    lines += [f"  not compared: {reason}" for reason in described["not_compared"]]
    return lines


def _columns(s: Mapping[str, float]) -> str:
    return "".join(f"{tabled(s[key]):>9}" for key in ("mean", "sd", "p05", "p50", "p95")).rjust(50)
