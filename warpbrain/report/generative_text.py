"""What the generative model of tissue says of itself, of moduli and of laws: tables for the terminal, and as CSV."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.gp.asymmetry import Asymmetry
from warpbrain.gp.metamodels import Fit
from warpbrain.gp.process import Process
from warpbrain.gp.sampling import CURVES, DrawnLaws, Moduli, rejection_rate
from warpbrain.report.files import write_csv


def asymmetry_lines(found: Sequence[Asymmetry], papers: Mapping[str, tuple[float, bool]]) -> list[str]:
    """Compression and tension, a line for each group, and one of the literature, as of `asymmetries_of_papers`."""
    width = max(len(one.group) for one in found)
    lines = [
        f"{'tension over compression, secant moduli':<{width + 20}}  mean of papers (95 % interval)   "
        "a new study (95 %)   stiffer in tension"
    ]
    for one in found:
        mean, low, high, new_low, new_high = np.exp([one.mean, one.low, one.high, one.new_low, one.new_high]).tolist()
        lines.append(
            f"{one.group:<{width + 2}}strain to {one.strain:<8.2g}  {f'{mean:.2f} ({low:.2f} to {high:.2f})':<32}"
            f"{f'{new_low:.2f} to {new_high:.2f}':<18}{100.0 * one.tension:>17.0f} %"
        )
    compression = sum(value < 0.0 for value, _ in papers.values())
    tension = sum(value > 0.0 for value, _ in papers.values())
    lines.append(
        f"of {len(papers)} hyperelastic papers {compression} are stiffer in compression, {tension} in tension; "
        f"{sum(not able for _, able in papers.values())} have symmetric forms only, which say nothing of it"
    )
    return lines


def fit_lines(model: Process, record: Mapping[str, Any]) -> list[str]:
    """Objective, convergence, restarts, conditioning and time of a record of `warpbrain.gp.trained.fit_model`."""
    lines = [f"{model.name} model of the literature as {model.variant}, {record['studies']} studies"]
    if "climbs" not in record:
        lines += [
            f"  objective   {record['objective']:.3f} (negative log of likelihood times prior)",
            f"  {_converged(record)} after {record['iterations']} iterations: {record['message']}",
            f"  condition   {record['condition']:.2g} of the covariance; no jitter: what studies leave open is in it",
        ]
    else:
        starts = record["starts"]
        apart = starts[0]["apart"]
        lines += [
            f"  objective   {record['negative log likelihood']:.3f} (negative log marginal likelihood of "
            f"{record['points']} points, {record['means of replicates']} means)",
            f"  jitter      {record['jitter']:g} on the diagonal",
            f"  starts      {len(starts)} on every {starts[0]['every']}th stretch, values "
            f"{starts[0]['value']:.2f} to {starts[-1]['value']:.2f}; best: "
            + ("all groups together" if apart is None else f"{apart} apart"),
        ]
        for index, climb in enumerate(record["climbs"], 1):
            lines.append(
                f"  climb {index}     {climb['value']:.3f}, {_converged(climb)} after {climb['iterations']} "
                f"iterations, last gain {climb['gain']:.1g}, largest derivative {climb['gradient']:.2g}, "
                f"condition {climb['condition']:.1g}"
            )
    return [*lines, f"  time        {record['seconds']:.1f} s"]


def _converged(record: Mapping[str, Any]) -> str:
    return "converged" if record["converged"] else "NOT converged"


def moduli_lines(found: Sequence[Moduli]) -> list[str]:
    """A line for each group and law; a modulus in brackets is that of a curve whose law is unstable."""
    width = max(len(one.group) for one in found)
    curves = "".join(f"{f'k = {k:+g}' if k else 'mean':>11}" for k in CURVES)
    lines = [
        f"{'shear modulus at rest [Pa]':<{width + 16}}{curves}   draws: median (95 % of them)        redrawn   "
        "law of the mean curve"
    ]
    for one in found:
        cells = "".join(
            f"{f'({fitted.shear_modulus:.4g})' if reason else f'{fitted.shear_modulus:.4g}':>11}"
            for fitted, reason in zip(one.fits, one.unstable, strict=True)
        )
        drawn = f"{one.median:.4g} ({one.low:.3g} to {one.high:.3g})"
        lines.append(
            f"{one.group:<{width + 2}}{one.law:<14}{cells}   {drawn:<34} {100 * one.rejection_rate:>5.1f} %   "
            f"{_law_text(one.fits[CURVES.index(0.0)])}"
        )
    return lines


def _law_text(fitted: Fit) -> str:
    """As `mu = 300 Pa, alpha = 5`; what lies at a bound of the fit is marked."""
    return ", ".join(
        f"{name} = {value:.5g}{f' {unit}' if unit else ''}{' (at its bound)' if name in fitted.at_bound else ''}"
        for name, value, unit in zip(fitted.model.parameter_names, fitted.values, fitted.model.units, strict=True)
    )


def write_moduli(path: Path, found: Sequence[Moduli]) -> None:
    """Write what `moduli_lines` says, a row for each group, law and curve."""
    head = (
        *("group", "law", "k", "shear modulus [Pa]", "parameters", "rms of fit [log units]", "unstable"),
        *("median of draws [Pa]", "2.5 % [Pa]", "97.5 % [Pa]", "draws", "redrawn"),
    )
    rows = [
        [
            *(one.group, one.law, k, repr(fitted.shear_modulus), _law_text(fitted), repr(fitted.rms), reason),
            *(repr(one.median), repr(one.low), repr(one.high), one.draws, repr(one.rejection_rate)),
        ]
        for one in found
        for k, fitted, reason in zip(CURVES, one.fits, one.unstable, strict=True)
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
    head, over = list(first), [""] * len(first)
    for group, fitted in zip(groups, rows[0].fits, strict=True):
        names = _parameters(fitted)
        head += names
        over += [group, *[""] * (len(names) - 1)]
    body = [
        [*row.labels, *(f"{value:.5g}" for fitted in row.fits for value in (*fitted.values, fitted.shear_modulus))]
        for row in rows
    ]
    widths = [max(10, *(len(line[i]) for line in [head, *body])) + 2 for i in range(len(head))]
    # a group stands above the first of its columns and may be longer than it
    above = ""
    for place, name in enumerate(over):
        start = sum(widths[: place + 1]) - len(head[place])
        if name:
            above = f"{above:<{start}}{name}"
    lines = ("".join(f"{cell:>{width}}" for cell, width in zip(line, widths, strict=True)) for line in [head, *body])
    return [above, *lines]


def redrawn_lines(draws: Sequence[DrawnLaws]) -> list[str]:
    """How many attempts were unstable, and why most of them were."""
    reasons = [reason for drawn in draws for reason in drawn.rejected]
    # what is wrong stands last: after the group, and the law and its numbers
    kinds = Counter(reason.rsplit(": ", 1)[-1] for reason in reasons)
    return [
        f"unstable and redrawn: {len(reasons)} of {len(reasons) + len(draws)} attempts "
        f"({100 * rejection_rate(draws):.1f} %)",
        *(
            f"  {count} because {kind}, such as {next(reason for reason in reasons if reason.endswith(kind))}"
            for kind, count in kinds.most_common(3)
        ),
    ]
