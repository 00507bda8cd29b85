"""What mechanisms cost beside the plain model, from the files that `python -m warpbrain.bench mechanisms` wrote."""

from __future__ import annotations

import json
import statistics
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

#: The row of the plain model beside itself.
PLAIN = "plain"
Costs = Mapping[str, Any]


def read_costs(paths: Iterable[Path]) -> list[Costs]:
    """Measurements, one a file."""
    return [json.loads(path.read_text(encoding="utf-8")) for path in paths]


def ratio(samples: Mapping[str, Sequence[float]]) -> float:
    """How much longer it took with a mechanism than without: the median over neighbours in time."""
    return statistics.median(b / a for a, b in zip(samples["plain"], samples["with"], strict=True))


def machine(costs: Costs) -> str:
    """Where and when costs were measured."""
    return f"{costs['device']}, {costs['date']}"


def row_of(costs: Costs, kind: str) -> Mapping[str, Any] | None:
    """What was measured of a mechanism; None if nothing was."""
    return next((row for row in costs["rows"] if row["kind"] == kind), None)


def sentences(measured: Sequence[Costs], kind: str) -> list[str]:
    """What a mechanism's example costs, a line a machine."""
    lines = []
    for costs in measured:
        row = row_of(costs, kind)
        if row is not None:
            cg = [statistics.median(row["cg_iterations"][which]) for which in ("plain", "with")]
            newton = [statistics.median(row["newton_iterations"][which]) for which in ("plain", "with")]
            lines.append(
                f"- {machine(costs)}: a time step takes {ratio(row['step']):.2f} times that of the plain model "
                f"({cg[1]:g} iterations of conjugate gradients for {cg[0]:g}), an iteration of Newton's method "
                f"{ratio(row['newton']):.2f} times ({newton[1]:g} iterations to equilibrium for {newton[0]:g})."
            )
    return lines


def table(measured: Sequence[Costs], kinds: Sequence[str]) -> list[str]:
    """All mechanisms and the plain model beside itself, two columns a machine."""
    if not measured:
        return ["Not measured yet."]
    heads = [f"{machine(costs)}: {what}" for costs in measured for what in ("step", "Newton iteration")]
    lines = [f"| | {' | '.join(heads)} |", "|---|" + "---|" * len(heads)]
    for kind in (PLAIN, *kinds):
        cells = []
        for costs in measured:
            row = row_of(costs, kind)
            cells += ["", ""] if row is None else [f"{ratio(row[what]):.2f}" for what in ("step", "newton")]
        lines.append(f"| {f'{PLAIN} beside {PLAIN}' if kind == PLAIN else kind} | {' | '.join(cells)} |")
    return lines
