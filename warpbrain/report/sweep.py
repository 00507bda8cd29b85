"""A sweep over curves of the generative model: its table, from which an interrupted one goes on, and its text."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from pathlib import Path

from warpbrain.atomic import whole_file
from warpbrain.errors import InputError
from warpbrain.estimation.parameters import Parameters
from warpbrain.estimation.sweep import Steps, Sweep, SweepPoint
from warpbrain.report.comparison import SHOWN

#: Name of the file.
TABLE = "sweep.csv"


def columns(parameters: Parameters, fingerprint: str) -> list[str]:
    """The header: the last column names what the sweep is of, by a fingerprint of its inputs."""
    steps = [f"k {tissue}" for tissue in parameters.tissues]
    return [*steps, *parameters.names, "rms [m or N]", f"no equilibrium; inputs {fingerprint}"]


def write_sweep(path: Path, header: list[str], points: Iterable[SweepPoint]) -> None:
    """Write points, a line each."""
    with whole_file(path) as unfinished, unfinished.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        for point in points:
            error = "" if point.error is None else repr(point.error)
            writer.writerow([*map(repr, point.k), *map(repr, point.theta), error, point.reason])


def read_sweep(path: Path, header: list[str], tissues: int) -> dict[Steps, SweepPoint]:
    """Points of a file that an interrupted sweep left, by their `k`; none if there is no file.

    Raises
    ------
    InputError
        If it is not such a file, or is of other inputs.
    """
    if not path.exists():
        return {}
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))
    if not rows or rows[0] != header:
        raise InputError(f"{path}: a sweep of something else: take the file away to begin again")
    found = {}
    for line, row in enumerate(rows[1:], 2):
        try:
            numbers = [float(value) for value in row[:-2]]
            error = float(row[-2]) if row[-2] else None
            steps = tuple(numbers[:tissues])
            found[steps] = SweepPoint(steps, tuple(numbers[tissues:]), error, row[-1])
        except (ValueError, IndexError):
            raise InputError(f"{path}: line {line}: cannot be read: take the file away to begin again") from None
    return found


def sweep_lines(sweep: Sweep) -> list[str]:
    """What is printed of a finished sweep."""
    best = sweep.best
    factor, unit = SHOWN[sweep.unit]
    failed = sum(point.error is None for point in sweep.points)
    laws = zip(sweep.parameters.tissues, best.k, sweep.parameters.laws(best.theta), strict=True)
    lines = [f"least error of {len(sweep.points)} equilibria: RMSE {factor * (best.error or 0.0):.3f} {unit}"]
    lines += [
        f"  {tissue:<18} k = {k:+.2f}: shear modulus {law.shear_modulus:.5g} Pa  {law!r}" for tissue, k, law in laws
    ]
    if failed:
        lines.append(f"  without an equilibrium: {failed}")
    return lines
