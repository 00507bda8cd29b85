"""A sweep over curves of the generative model: its table, from which an interrupted one goes on, its text, and its
error surface, with the posterior's estimate on it where there is one.

Each line ends with a checksum of itself and of what the sweep is of: a point whose line is damaged is computed again.
"""

import csv
import hashlib
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.atomic import write_csv
from warpbrain.errors import InputError
from warpbrain.estimation.parameters import Parameters
from warpbrain.estimation.sweep import Steps, Sweep, SweepPoint
from warpbrain.report import views
from warpbrain.report.comparison import SHOWN
from warpbrain.report.page import lines
from warpbrain.report.views import BLACK, BLUE, VERMILLION

#: Name of the file.
TABLE = "sweep.csv"
#: Of a tissue: estimate of its shear modulus, lower and upper end of its interval [Pa].
Estimated = tuple[float, float, float]


def columns(parameters: Parameters, fingerprint: str) -> list[str]:
    """The header: the last column but one names what the sweep is of, by a fingerprint of its inputs."""
    steps = [f"k {tissue}" for tissue in parameters.tissues]
    return [*steps, *parameters.names, "rms [m or N]", f"no equilibrium; inputs {fingerprint}", "checksum"]


def write_sweep(path: Path, header: list[str], points: Iterable[SweepPoint]) -> None:
    """Write points, a line each."""
    rows = [header]
    for point in points:
        error = "" if point.error is None else repr(point.error)
        row = [*map(repr, point.k), *map(repr, point.theta), error, point.reason]
        rows.append([*row, _checksum(header, row)])
    write_csv(path, rows)


def read_sweep(path: Path, header: list[str], tissues: int) -> tuple[dict[Steps, SweepPoint], int]:
    """Points of a file that an interrupted sweep left, by their `k`, and how many of its lines are damaged.

    `InputError` if it is not such a file, or is of other inputs.
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
    points = {}
    for row in sound:
        numbers = [float(value) for value in row[:-3]]
        steps = tuple(numbers[:tissues])
        error = float(row[-3]) if row[-3] else None
        points[steps] = SweepPoint(steps, tuple(numbers[tissues:]), error, row[-2])
    return points, max(len(rows) - 1, 0) - len(sound)


def _checksum(header: list[str], row: list[str]) -> str:
    return hashlib.sha256("\n".join((*header, *row)).encode()).hexdigest()[:16]


def sweep_lines(sweep: Sweep) -> list[str]:
    """What is printed of a finished sweep."""
    best, (factor, unit) = sweep.best, SHOWN[sweep.unit]
    laws = zip(sweep.parameters.tissues, best.k, sweep.parameters.laws(best.theta), strict=True)
    failed = sum(point.error is None for point in sweep.points)
    return lines("estimate.txt", "sweep", len(sweep.points), factor * (best.error or 0.0), unit, list(laws), failed)


def estimated_in(path: Path) -> dict[str, Estimated]:
    """Shear moduli of tissues, by name, that an `estimate.json` says; none if there is no such file.

    `InputError` if it is not what `describe_estimate` says.
    """
    if not path.exists():
        return {}
    estimates: dict[str, Estimated] = {}
    try:
        for parameter in json.loads(path.read_text(encoding="utf-8"))["parameters"]:
            if parameter["name"] != "shear modulus":
                continue
            middle, low, high = float(parameter["estimate"]), *map(float, parameter["interval_95"])
            if not 0.0 < low <= middle <= high < math.inf:
                raise ValueError(f"{parameter['tissue']}: found {middle:g} in {low:g} to {high:g} Pa")
            estimates[parameter["tissue"]] = middle, low, high
    except (OSError, LookupError, TypeError, ValueError, RecursionError) as error:
        detail = " ".join(str(error).split())[:200]
        raise InputError(f"{path}: not an estimate to draw beside the sweep ({detail})") from None
    return estimates


def write_sweep_picture(path: Path, sweep: Sweep, title: str, estimated: Mapping[str, Estimated]) -> None:
    """Draw the error over the shear moduli of one tissue, or of the first two, as PNG.

    `estimated` is of the same case: see `estimated_in`.
    """
    figure, [axes] = views.panels(1, 1, (6.4, 5.2), layout="tight")
    if len(sweep.parameters.tissues) == 1:
        _draw_curve(axes, sweep, estimated)
    else:
        _draw_surface(figure, axes, sweep, estimated)
    axes.set_title(title, parse_math=False, fontsize=10)
    axes.legend(fontsize=9, loc="upper right")
    views.save(figure, path)


def _moduli_and_errors(sweep: Sweep, points: Sequence[SweepPoint]) -> tuple[Floats, Floats]:
    """Shear moduli [Pa] of points (n, tissues), and their errors (n,) in the unit that is shown; NaN without an
    equilibrium."""
    moduli = [[law.shear_modulus for law in sweep.parameters.laws(point.theta)] for point in points]
    factor = SHOWN[sweep.unit][0]
    return np.array(moduli), np.array([np.nan if point.error is None else factor * point.error for point in points])


def _draw_curve(axes: Any, sweep: Sweep, estimated: Mapping[str, Estimated]) -> None:
    moduli, errors = _moduli_and_errors(sweep, sweep.points)
    moduli = moduli[:, 0]
    order = np.argsort(moduli)
    axes.plot(moduli[order], errors[order], "o-", color=BLUE, markersize=5, label="sweep")
    best = int(np.nanargmin(errors))
    axes.plot(moduli[best], errors[best], "s", color=VERMILLION, markersize=9, label="best of the sweep")
    estimate = estimated.get(sweep.parameters.tissues[0])
    if estimate is not None:
        axes.axvline(estimate[0], color=BLACK, label="estimate")
        axes.axvspan(estimate[1], estimate[2], color=BLACK, alpha=0.15, linewidth=0, label="95 % interval")
    axes.set_xscale("log")
    axes.set_xlabel(f"shear modulus of {sweep.parameters.tissues[0]} [Pa]")
    axes.set_ylabel(f"RMSE at the fitted recordings [{SHOWN[sweep.unit][1]}]")


def _draw_surface(figure: Any, axes: Any, sweep: Sweep, estimated: Mapping[str, Estimated]) -> None:
    # of more than two tissues: the plane through the best point
    plane = sorted((p for p in sweep.points if p.k[2:] == sweep.best.k[2:]), key=lambda point: point.k)
    flat, errors = _moduli_and_errors(sweep, plane)
    moduli = flat[:, :2].reshape(len({point.k[0] for point in plane}), -1, 2)
    values = np.ma.masked_invalid(errors.reshape(len(moduli), -1))
    # far from the best the error says no more than that it is far
    top = min(float(values.max()), 3.0 * float(values.min()) + 1e-9)
    levels = np.linspace(float(values.min()), top, 13)
    filled = axes.contourf(moduli[..., 0], moduli[..., 1], values, levels=levels, cmap="viridis_r", extend="max")
    axes.contour(moduli[..., 0], moduli[..., 1], values, levels=levels[::2], colors="white", linewidths=0.5)
    solved = ~np.isnan(errors)
    axes.scatter(flat[solved, 0], flat[solved, 1], s=3, color="0.3", linewidths=0, label="sweep")
    if not solved.all():
        axes.scatter(flat[~solved, 0], flat[~solved, 1], s=14, marker="x", color="0.3", label="no equilibrium")
    best = flat[plane.index(sweep.best)]
    axes.plot(*best[:2], "s", color=VERMILLION, markeredgecolor="white", markersize=10, label="best of the sweep")
    along, upwards = (estimated.get(tissue) for tissue in sweep.parameters.tissues[:2])
    if along is not None and upwards is not None:
        (x, left, right), (y, low, high) = along, upwards
        axes.errorbar(
            [x], [y], xerr=[[x - left], [right - x]], yerr=[[y - low], [high - y]], fmt="o", color=BLACK,
            markeredgecolor="white", capsize=4, markersize=8, label="estimate, 95 % intervals",
        )  # fmt: skip
    axes.set_xscale("log")
    axes.set_yscale("log")
    first, second = sweep.parameters.tissues[:2]
    axes.set_xlabel(f"shear modulus of {first} [Pa]")
    axes.set_ylabel(f"shear modulus of {second} [Pa]")
    figure.colorbar(filled, ax=axes, format="%.3g" if top > 1.1 * float(values.min()) else "%.4g").set_label(
        f"RMSE at the fitted recordings [{SHOWN[sweep.unit][1]}]"
    )
