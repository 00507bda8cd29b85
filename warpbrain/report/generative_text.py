"""What the generative model of tissue says of itself, of moduli and of laws: tables for the terminal, and as CSV."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from warpbrain.atomic import write_csv
from warpbrain.gp.sampling import CURVES, DrawnLaws, Fit, Moduli, rejection_rate
from warpbrain.report.page import lines


def moduli_lines(moduli: Sequence[Moduli]) -> list[str]:
    """A line for each group and law; a modulus in brackets is that of a curve whose law is unstable."""
    middle = CURVES.index(0.0)
    rows = [(each, list(zip(each.fits, each.unstable, strict=True)), _law_text(each.fits[middle])) for each in moduli]
    return lines("gp.txt", "moduli", rows, max(len(tissue.group) for tissue in moduli), CURVES)


def _law_text(fitted: Fit) -> str:
    """As `mu = 300 Pa, alpha = 5`; what lies at a bound of the fit is marked."""
    return ", ".join(
        f"{name} = {value:.5g}{f' {unit}' if unit else ''}{' (at its bound)' if name in fitted.at_bound else ''}"
        for name, value, unit in zip(fitted.model.parameter_names, fitted.values, fitted.model.units, strict=True)
    )


def write_moduli(path: Path, moduli: Sequence[Moduli]) -> None:
    """Write what `moduli_lines` says, a row for each group, law and curve."""
    head = (
        *("group", "law", "k", "shear modulus [Pa]", "parameters", "rms of fit [log units]", "unstable"),
        *("median of draws [Pa]", "2.5 % [Pa]", "97.5 % [Pa]", "draws", "redrawn"),
    )
    rows = [
        [
            *(tissue.group, tissue.law, k, repr(fitted.shear_modulus), _law_text(fitted), repr(fitted.rms), reason),
            *(repr(tissue.median), repr(tissue.low), repr(tissue.high), tissue.draws, repr(tissue.rejection_rate)),
        ]
        for tissue in moduli
        for k, fitted, reason in zip(CURVES, tissue.fits, tissue.unstable, strict=True)
    ]
    write_csv(path, [head, *rows])


@dataclass(frozen=True)
class LawRow:
    """The laws of all tissues: what tells the row from others, a fit for each group, and why what is in the row, or
    what was drawn before it, is unstable."""

    labels: tuple[str, ...]
    fits: tuple[Fit, ...]
    reasons: tuple[str, ...]


def _parameters(fitted: Fit) -> list[str]:
    """Names with units."""
    named = zip(fitted.model.parameter_names, fitted.model.units, strict=True)
    return [*(f"{name} [{unit}]" if unit else name for name, unit in named), "mu0 [Pa]"]


def write_laws(path: Path, first: Sequence[str], groups: Sequence[str], rows: Sequence[LawRow], last: str) -> None:
    """Write all rows; `first` names the labels, `last` the reasons."""
    head = [
        f"{group}: {name}"
        for group, fitted in zip(groups, rows[0].fits, strict=True)
        for name in (*_parameters(fitted), "rms of fit", "at bound")
    ]
    lines = [[*first, *head, last]]
    for row in rows:
        cells = [
            cell
            for fitted in row.fits
            for cell in (*map(repr, (*fitted.values, fitted.shear_modulus, fitted.rms)), " ".join(fitted.at_bound))
        ]
        lines.append([*row.labels, *cells, "; ".join(row.reasons)])
    write_csv(path, lines)


def law_lines(first: Sequence[str], groups: Sequence[str], rows: Sequence[LawRow]) -> list[str]:
    """The table for the terminal: parameters and shear modulus of each group."""
    head, columns = list(first), []
    for fitted in rows[0].fits:
        columns.append(len(head))
        head += _parameters(fitted)
    table = [head] + [
        [*row.labels, *(f"{value:.5g}" for fitted in row.fits for value in (*fitted.values, fitted.shear_modulus))]
        for row in rows
    ]
    widths = [max(10, *map(len, column)) + 2 for column in zip(*table, strict=True)]
    # a group stands above the first of its columns and may be longer than it
    above = ""
    for column, group in zip(columns, groups, strict=True):
        above = f"{above:<{sum(widths[: column + 1]) - len(head[column])}}{group}"
    return [above, *("".join(map(str.rjust, line, widths)) for line in table)]


def redrawn_lines(draws: Sequence[DrawnLaws]) -> list[str]:
    """How many attempts were unstable, and why most of them were."""
    reasons = [reason for drawn in draws for reason in drawn.rejected]
    # what is wrong stands last: after the group, and the law and its numbers
    kinds = Counter(reason.rsplit(": ", 1)[-1] for reason in reasons).most_common(3)
    examples = [(count, kind, next(reason for reason in reasons if reason.endswith(kind))) for kind, count in kinds]
    return lines("gp.txt", "redrawn", len(reasons), len(draws), rejection_rate(draws), examples)
