"""What mechanisms cost beside the plain model, from the files that `python -m warpbrain.bench mechanisms` wrote."""

from __future__ import annotations

import json
import statistics
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from warpbrain.physics.mechanisms import mechanisms

#: The row of the plain model beside itself.
PLAIN = "plain"
#: How many times as long as a plain step is called long, and a plain iteration of the linear solver.
_LONG, _HARD = 3.0, 1.5
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


def reasons(measured: Sequence[Costs]) -> list[str]:
    """Why steps with some mechanisms take long, a line a machine and mechanism; none if none does."""
    lines = []
    for costs in measured:
        for row in costs["rows"]:
            longer = ratio(row["step"])
            if longer < _LONG:
                continue
            plain, taken = _medians(row["cg_iterations"])
            line = f"- {row['kind']}, {machine(costs)}{_other_example(row)}: {longer:.1f} times. "
            line += f"The linear solver takes {taken:g} iterations for {plain:g}"
            each = longer * plain / taken
            line += f", and {each:.1f} times as long for each" if each > _HARD else ""
            lines.append(f"{line}.")
    return lines


def _medians(samples: Mapping[str, Sequence[float]]) -> tuple[float, float]:
    """Without and with a mechanism."""
    return statistics.median(samples["plain"]), statistics.median(samples["with"])


def _other_example(row: Mapping[str, Any]) -> str:
    """What was measured, where that is not the mechanism's present example."""
    known = mechanisms().get(row["kind"])
    return f" (`{row['example']}`)" if known is not None and row["example"] != known.example else ""


def table(measured: Sequence[Costs], kinds: Sequence[str]) -> list[str]:
    """All mechanisms and the plain model beside itself, two columns a machine, as CSV."""
    heads = [f"{machine(costs)}: {what}" for costs in measured for what in ("step", "Newton iteration")]
    lines = [",".join(["", *(f'"{head}"' for head in heads)])]
    for kind in (PLAIN, *kinds):
        cells = []
        for costs in measured:
            row = row_of(costs, kind)
            cells += ["", ""] if row is None else [f"{ratio(row[what]):.2f}" for what in ("step", "newton")]
        lines.append(",".join([f"{PLAIN} beside {PLAIN}" if kind == PLAIN else kind, *cells]))
    return lines
