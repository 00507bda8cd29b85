"""A sweep over curves of the generative model: its table, from which an interrupted one goes on, and its text.

Each line ends with a checksum of itself and of what the sweep is of: a point whose line is damaged is computed again.
"""

from __future__ import annotations

import csv
import hashlib
from collections.abc import Iterable
from pathlib import Path

from warpbrain.atomic import whole_file
from warpbrain.errors import InputError
from warpbrain.estimation.parameters import Parameters
from warpbrain.estimation.sweep import Steps, Sweep, SweepPoint
from warpbrain.physics.words import tabled
from warpbrain.report.comparison import SHOWN

#: Name of the file.
TABLE = "sweep.csv"


def columns(parameters: Parameters, fingerprint: str) -> list[str]:
    """The header: the last column but one names what the sweep is of, by a fingerprint of its inputs."""
    steps = [f"k {tissue}" for tissue in parameters.tissues]
    return [*steps, *parameters.names, "rms [m or N]", f"no equilibrium; inputs {fingerprint}", "checksum"]


def write_sweep(path: Path, header: list[str], points: Iterable[SweepPoint]) -> None:
    """Write points, a line each."""
    with whole_file(path) as unfinished, unfinished.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        for point in points:
            error = "" if point.error is None else repr(point.error)
            row = [*map(repr, point.k), *map(repr, point.theta), error, point.reason]
            writer.writerow([*row, _checksum(header, row)])


def read_sweep(path: Path, header: list[str], tissues: int) -> tuple[dict[Steps, SweepPoint], int]:
    """Points of a file that an interrupted sweep left, by their `k`, and how many of its lines are damaged.

    Raises
    ------
    InputError
        If it is not such a file, or is of other inputs.
    """
    if not path.exists():
        return {}, 0
    with path.open(newline="", encoding="utf-8", errors="replace") as file:
        # a NUL is what a disk leaves of lines, and no reader of CSV takes it
        rows = list(csv.reader(line.replace("\0", "?") for line in file))
    sound = [row for row in rows[1:] if row and row[-1] == _checksum(header, row[:-1])]
    first = ",".join(rows[0]) if rows else ""
    # what is cut off in its first line, or is all zeros, has no points of any sweep
    if not sound and first.strip("?") and not ",".join(header).startswith(first):
        raise InputError(f"{path}: a sweep of something else: take the file away to begin again")
    found = {}
    for row in sound:
        numbers = [float(value) for value in row[:-3]]
        steps = tuple(numbers[:tissues])
        error = float(row[-3]) if row[-3] else None
        found[steps] = SweepPoint(steps, tuple(numbers[tissues:]), error, row[-2])
    return found, max(len(rows) - 1, 0) - len(sound)


def _checksum(header: list[str], row: list[str]) -> str:
    return hashlib.sha256("\n".join((*header, *row)).encode()).hexdigest()[:16]


def sweep_lines(sweep: Sweep) -> list[str]:
    """What is printed of a finished sweep."""
    best = sweep.best
    factor, unit = SHOWN[sweep.unit]
    failed = sum(point.error is None for point in sweep.points)
    laws = zip(sweep.parameters.tissues, best.k, sweep.parameters.laws(best.theta), strict=True)
    lines = [f"least error of {len(sweep.points)} equilibria: RMSE {tabled(factor * (best.error or 0.0))} {unit}"]
    lines += [
        f"  {tissue:<18} k = {k:+.2f}: shear modulus {law.shear_modulus:.5g} Pa  {law!r}" for tissue, k, law in laws
    ]
    if failed:
        lines.append(f"  without an equilibrium: {failed}")
    return lines
