"""Laws of draws or curves as a table: for the terminal, and as CSV."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from warpbrain.atomic import whole_file
from warpbrain.gp.metamodels import Fit
from warpbrain.gp.sampling import DrawnLaws, rejection_rate


@dataclass(frozen=True)
class LawRow:
    """One row: the laws of all tissues.

    Attributes
    ----------
    labels : tuple of str
        What tells the row from others, one for each of the table's first columns.
    fits : tuple of Fit
        One for each group.
    reasons : tuple of str
        Why what is in the row, or what was drawn before it, is unstable.
    """

    labels: tuple[str, ...]
    fits: tuple[Fit, ...]
    reasons: tuple[str, ...]


def columns(groups: Sequence[str], fits: Sequence[Fit]) -> list[str]:
    """Names, with units, of what is told of each group."""
    names = []
    for group, fitted in zip(groups, fits, strict=True):
        model = fitted.model
        named = [
            f"{name} [{unit}]" if unit else name for name, unit in zip(model.parameter_names, model.units, strict=True)
        ]
        names += [f"{group}: {name}" for name in (*named, "mu0 [Pa]", "rms of fit", "at bound")]
    return names


def write_laws(path: Path, first: Sequence[str], groups: Sequence[str], rows: Sequence[LawRow], last: str) -> None:
    """Write all rows; `first` names the labels, `last` the reasons."""
    with whole_file(path) as unfinished, unfinished.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([*first, *columns(groups, rows[0].fits), last])
        for row in rows:
            cells: list[str] = []
            for fitted in row.fits:
                cells += [*map(repr, fitted.values), repr(fitted.shear_modulus), repr(fitted.rms)]
                cells.append(" ".join(fitted.at_bound))
            writer.writerow([*row.labels, *cells, "; ".join(row.reasons)])


def law_lines(first: Sequence[str], groups: Sequence[str], rows: Sequence[LawRow]) -> list[str]:
    """The table for the terminal: parameters and shear modulus of each group."""
    head, units = list(first), [""] * len(first)
    for group, fitted in zip(groups, rows[0].fits, strict=True):
        for name, unit in zip(fitted.model.parameter_names, fitted.model.units, strict=True):
            head.append(f"{name} [{unit}]" if unit else name)
            units.append(group)
            group = ""
        head.append("mu0 [Pa]")
        units.append("")
    body = []
    for row in rows:
        cells = list(row.labels)
        for fitted in row.fits:
            cells += [f"{value:.5g}" for value in (*fitted.values, fitted.shear_modulus)]
        body.append(cells)
    widths = [max(10, *(len(line[i]) for line in [head, *body])) + 2 for i in range(len(head))]
    # a group stands above the first of its columns and may be longer than it
    above = ""
    for place, name in enumerate(units):
        start = sum(widths[: place + 1]) - len(head[place])
        if name:
            above = f"{above:<{start}}{name}"
    return [
        above,
        *("".join(f"{cell:>{width}}" for cell, width in zip(line, widths, strict=True)) for line in [head, *body]),
    ]


def redrawn_lines(draws: Sequence[DrawnLaws]) -> list[str]:
    """How many attempts were unstable, and why most of them were."""
    reasons = [reason for drawn in draws for reason in drawn.rejected]
    lines = [
        f"unstable and redrawn: {len(reasons)} of {len(reasons) + len(draws)} attempts "
        f"({100 * rejection_rate(draws):.1f} %)"
    ]
    # what is wrong stands last: after the group, and the law and its numbers
    kinds = Counter(reason.rsplit(": ", 1)[-1] for reason in reasons)
    for kind, count in kinds.most_common(3):
        lines.append(f"  {count} because {kind}, such as {next(reason for reason in reasons if reason.endswith(kind))}")
    return lines
