"""Scores as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from referee.intervals import Share
from referee.outcomes import Outcome
from referee.scores import AT_LEAST, AT_MOST

#: A share may be so far below that of the optimal analyst, where that is below the bar.
BELOW = 0.05


def score_text(
    scored: Mapping[str, Share],
    calibrated: Mapping[str, Any],
    measured: Mapping[str, Mapping[str, Any]],
    confused: tuple[list[str], list[str], list[list[int]]],
    baselines: Mapping[str, Mapping[str, Share]],
    beside: Mapping[str, Mapping[str, Share]],
    outcomes: Sequence[Outcome],
    missing: Sequence[str],
    optimal: Mapping[str, Share],
    right: Mapping[str, float],
) -> str:
    """The page of scores.

    `optimal` are the shares of the optimal analyst and `right` how often it is right in each case, see
    `referee.analyst`; empty if it was not asked.
    """
    lines = ["# Scores", ""]
    lines += [
        f"{len(outcomes)} cases; {len(missing)} without a diagnosis{': ' if missing else ''}{', '.join(missing)}."
    ]
    lines += [
        "",
        "| score | share with 95 % interval (Clopper-Pearson) | the optimal analyst | bar | |",
        "|---" * 5 + "|",
    ]
    for name, value in scored.items():
        best = percent(optimal.get(name))
        wanted, bar = _bar(name, optimal.get(name))
        lines.append(f"| {name} | {value} | {best} | {wanted} | {_met(name, value, bar)} |")
    for name, words in (("spoken", "spoken names"), ("all", "all stated probabilities")):
        ece = calibrated[name]["ece"]
        error = "-" if ece is None else f"{ece:.3f}"
        lines.append(f"| expected calibration error, {words} | {error} | | <= 0.05 | {_within(ece, 0.05)} |")
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
        for method, row in {"the tool": {name: scored[name] for name in names}, **baselines}.items():
            lines.append(f"| {method} | {' | '.join(str(row[name]) for name in names)} |")
        lines.append(f"| the optimal analyst | {' | '.join(percent(optimal.get(name)) for name in names)} |")
    if beside:
        lines += ["", f"| score, in cases of all | {' | '.join(beside)} | the optimal analyst |"]
        lines += ["|---" * (len(beside) + 2) + "|"]
        for key in scored:
            lines.append(
                f"| {key} | {' | '.join(str(row[key]) for row in beside.values())} | {percent(optimal.get(key))} |"
            )
    rows, columns, table = confused
    lines += ["", f"| true \\ said | {' | '.join(columns)} |", "|---" * (len(columns) + 1) + "|"]
    for true, counts in zip(rows, table, strict=True):
        lines.append(f"| {true} | {' | '.join(str(count) if count else '' for count in counts)} |")
    lines += [
        "",
        "| case | true | d | each given the other | the tool's d | the old d | effect at points [mm] | said "
        "| best candidate | the optimal analyst right |",
        "|---" * 10 + "|",
    ]
    for o in outcomes:
        said = " + ".join(o.said.names) or ", ".join(o.said.group)
        true = " + ".join(o.label["names"]) or "nothing"
        size = 1e3 * float(o.label["rms_effect_m"])
        given = ", ".join(f"{d:.1f}" for d in o.given) if o.kind == "two" else ""
        d = f"{o.d:.1f} | {given} | {'' if o.seen is None else f'{o.seen:.1f}'} | {o.upper:.1f}"
        best = f"{100 * right[o.name]:.0f} %" if o.name in right else ""
        lines.append(f"| {o.name} | {true} | {d} | {size:.2f} | {o.said.verdict}: {said} | {o.said.first} | {best} |")
    return "\n".join(lines) + "\n"


def percent(value: Share | None) -> str:
    """A share without its interval; nothing of nothing."""
    return "" if value is None or value.value is None else f"{100 * value.value:.0f} %"


def _bar(name: str, optimal: Share | None) -> tuple[str, tuple[float, float]]:
    """Words and ends of a bar: that of the optimal analyst less `BELOW` where it does not reach the announced one."""
    if name in AT_MOST:
        return f"<= {100 * AT_MOST[name]:.0f} %", (0.0, AT_MOST[name])
    if name not in AT_LEAST:
        return "", (0.0, 1.0)
    bar = AT_LEAST[name]
    if optimal is None or optimal.value is None or optimal.value >= bar:
        return f">= {100 * bar:.0f} %", (bar, 1.0)
    least = max(optimal.value - BELOW, 0.0)
    return f">= {100 * least:.0f} % (announced {100 * bar:.0f} %, above the optimal analyst)", (least, 1.0)


def _within(value: float | None, bar: float) -> str:
    return "" if value is None else "met" if value <= bar else "NOT met"


def _met(name: str, value: Share, bar: tuple[float, float]) -> str:
    if value.value is None or (name not in AT_MOST and name not in AT_LEAST):
        return ""
    return "met" if bar[0] <= value.value <= bar[1] else "NOT met"
