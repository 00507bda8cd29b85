"""Scores as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from referee.intervals import Share
from referee.outcomes import Outcome
from referee.scores import BARS


def score_text(
    found: Mapping[str, Share],
    calibrated: Mapping[str, Any],
    measured: Mapping[str, Mapping[str, Any]],
    confused: tuple[list[str], list[str], list[list[int]]],
    baselines: Mapping[str, Mapping[str, Share]],
    beside: Mapping[str, Mapping[str, Share]],
    outcomes: Sequence[Outcome],
    missing: Sequence[str],
) -> str:
    """The page of scores."""
    lines = ["# Scores", ""]
    lines += [
        f"{len(outcomes)} cases; {len(missing)} without a diagnosis{': ' if missing else ''}{', '.join(missing)}."
    ]
    lines += ["", "| score | share with 95 % interval (Clopper-Pearson) | bar | |", "|---|---|---|---|"]
    for name, value in found.items():
        bar = BARS.get(name)
        lines.append(f"| {name} | {value} | {_bar(name, bar)} | {_met(name, value, bar)} |")
    for name, words in (("spoken", "spoken names"), ("all", "all stated probabilities")):
        ece = calibrated[name]["ece"]
        told = "-" if ece is None else f"{ece:.3f}"
        lines.append(f"| expected calibration error, {words} | {told} | <= 0.05 | {_within(ece, 0.05)} |")
    lines += ["", "| measured, d >= 5 | median | quartiles | of |", "|---|---|---|---|"]
    for name, row in measured.items():
        if row["of"]:
            low, high = row["quartiles"]
            mean = f"; mean {row['mean']:.2f}" if row.get("mean") is not None else ""
            lines.append(f"| {name} | {row['median']:.3g}{mean} | {low:.3g} to {high:.3g} | {row['of']} |")
        else:
            lines.append(f"| {name} | - | - | 0 |")
    if baselines:
        names = list(next(iter(baselines.values())))
        lines += ["", f"| method | {' | '.join(names)} |", "|---" * (len(names) + 1) + "|"]
        for method, row in {"the tool": {name: found[name] for name in names}, **baselines}.items():
            lines.append(f"| {method} | {' | '.join(str(row[name]) for name in names)} |")
    if beside:
        lines += ["", f"| score, in cases of all | {' | '.join(beside)} |", "|---" * (len(beside) + 1) + "|"]
        lines += [f"| {key} | {' | '.join(str(row[key]) for row in beside.values())} |" for key in found]
    rows, columns, table = confused
    lines += ["", f"| true \\ said | {' | '.join(columns)} |", "|---" * (len(columns) + 1) + "|"]
    for true, counts in zip(rows, table, strict=True):
        lines.append(f"| {true} | {' | '.join(str(count) if count else '' for count in counts)} |")
    lines += [
        "",
        "| case | true | d | the tool's d | the old d | effect at points [mm] | said | best candidate |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for o in outcomes:
        said = " + ".join(o.said.names) or ", ".join(o.said.group)
        true = " + ".join(o.label["names"]) or "nothing"
        size = 1e3 * float(o.label["rms_effect_m"])
        d = f"{o.d:.1f} | {'' if o.seen is None else f'{o.seen:.1f}'} | {o.upper:.1f}"
        lines.append(f"| {o.name} | {true} | {d} | {size:.2f} | {o.said.verdict}: {said} | {o.said.first} |")
    return "\n".join(lines) + "\n"


def _most(name: str) -> bool:
    return name.startswith(("false alarms", "significant", "traps"))


def _bar(name: str, bar: float | None) -> str:
    return "" if bar is None else f"{'<=' if _most(name) else '>='} {100 * bar:.0f} %"


def _within(value: float | None, bar: float) -> str:
    return "" if value is None else "met" if value <= bar else "NOT met"


def _met(name: str, value: Share, bar: float | None) -> str:
    if bar is None or value.value is None:
        return ""
    return "met" if (value.value <= bar if _most(name) else value.value >= bar) else "NOT met"
