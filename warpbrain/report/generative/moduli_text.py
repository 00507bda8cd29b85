"""What a generative model says of shear moduli: a table for the terminal, and the same as CSV."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

from warpbrain.atomic import whole_file
from warpbrain.gp.metamodels import Fit
from warpbrain.gp.sampling import CURVES, Moduli


def moduli_lines(found: Sequence[Moduli]) -> list[str]:
    """A line for each group and law.

    A shear modulus in brackets is that of a curve whose law is unstable.
    """
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
        middle = one.fits[CURVES.index(0.0)]
        lines.append(
            f"{one.group:<{width + 2}}{one.law:<14}{cells}   {drawn:<34} {100 * one.rejection_rate:>5.1f} %   "
            f"{law_text(middle)}"
        )
    return lines


def law_text(fitted: Fit) -> str:
    """As `mu = 300 Pa, alpha = 5`; what lies at a bound of the fit is marked."""
    said = []
    for name, value, unit in zip(fitted.model.parameter_names, fitted.values, fitted.model.units, strict=True):
        bound = " (at its bound)" if name in fitted.at_bound else ""
        said.append(f"{name} = {value:.5g}{f' {unit}' if unit else ''}{bound}")
    return ", ".join(said)


def write_moduli(path: Path, found: Sequence[Moduli]) -> None:
    """Write what the lines say, a row for each group, law and curve."""
    with whole_file(path) as unfinished, unfinished.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(
            [
                *("group", "law", "k", "shear modulus [Pa]", "parameters", "rms of fit [log units]", "unstable"),
                *("median of draws [Pa]", "2.5 % [Pa]", "97.5 % [Pa]", "draws", "redrawn"),
            ]
        )
        for one in found:
            drawn = (repr(one.median), repr(one.low), repr(one.high), one.draws, repr(one.rejection_rate))
            for k, fitted, reason in zip(CURVES, one.fits, one.unstable, strict=True):
                law = (repr(fitted.shear_modulus), law_text(fitted), repr(fitted.rms), reason)
                writer.writerow([one.group, one.law, k, *law, *drawn])
