"""The error surface of a sweep, with the posterior's estimate on it where there is one."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import InputError
from warpbrain.estimation.sweep import Sweep
from warpbrain.report import views
from warpbrain.report.comparison import SHOWN

_SWEEP, _BEST, _ESTIMATE = "#0072B2", "#D55E00", "#000000"


#: Of a tissue: estimate of its shear modulus, lower and upper end of its interval [Pa].
Estimated = tuple[float, float, float]


def estimated_in(path: Path) -> dict[str, Estimated]:
    """Shear moduli of tissues, by name, that an `estimate.json` says; none if there is no such file.

    Raises
    ------
    InputError
        If it is not what `describe_estimate` says.
    """
    if not path.exists():
        return {}
    found: dict[str, Estimated] = {}
    try:
        for one in json.loads(path.read_text(encoding="utf-8"))["parameters"]:
            if one["name"] != "shear modulus":
                continue
            middle, low, high = float(one["estimate"]), *map(float, one["interval_95"])
            if not 0.0 < low <= middle <= high < math.inf:
                raise ValueError(f"{one['tissue']}: found {middle:g} in {low:g} to {high:g} Pa")
            found[one["tissue"]] = middle, low, high
    except (OSError, LookupError, TypeError, ValueError, RecursionError) as error:
        detail = " ".join(str(error).split())[:200]
        raise InputError(f"{path}: not an estimate to draw beside the sweep ({detail})") from None
    return found


def write_sweep_picture(path: Path, sweep: Sweep, title: str, estimated: Mapping[str, Estimated]) -> None:
    """Draw the error over the shear moduli of one tissue, or of the first two.

    Parameters
    ----------
    path : Path
        PNG file.
    sweep : Sweep
    title : str
    estimated : mapping
        Of the same case: see `estimated_in`.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6.4, 5.2))
    if len(sweep.parameters.tissues) == 1:
        _draw_curve(axes, sweep, estimated)
    else:
        _draw_surface(figure, axes, sweep, estimated)
    axes.set_title(title, parse_math=False, fontsize=10)
    axes.legend(fontsize=9, loc="upper right")
    figure.tight_layout()
    views.save(figure, path)
    plt.close(figure)


def _moduli(sweep: Sweep) -> Floats:
    """Shear moduli [Pa] of every point, shape (n, tissues)."""
    return np.array([[law.shear_modulus for law in sweep.parameters.laws(point.theta)] for point in sweep.points])


def _draw_curve(axes: Any, sweep: Sweep, estimated: Mapping[str, Estimated]) -> None:
    factor, unit = SHOWN[sweep.unit]
    moduli = _moduli(sweep)[:, 0]
    errors = np.array([np.nan if point.error is None else factor * point.error for point in sweep.points])
    order = np.argsort(moduli)
    axes.plot(moduli[order], errors[order], "o-", color=_SWEEP, markersize=5, label="sweep")
    best = int(np.nanargmin(errors))
    axes.plot(moduli[best], errors[best], "s", color=_BEST, markersize=9, label="best of the sweep")
    found = estimated.get(sweep.parameters.tissues[0])
    if found is not None:
        axes.axvline(found[0], color=_ESTIMATE, label="estimate")
        axes.axvspan(found[1], found[2], color=_ESTIMATE, alpha=0.15, linewidth=0, label="95 % interval")
    axes.set_xscale("log")
    axes.set_xlabel(f"shear modulus of {sweep.parameters.tissues[0]} [Pa]")
    axes.set_ylabel(f"RMSE at the fitted recordings [{unit}]")


def _draw_surface(figure: Any, axes: Any, sweep: Sweep, estimated: Mapping[str, Estimated]) -> None:
    factor, unit = SHOWN[sweep.unit]
    # of more than two tissues: the plane through the best point
    inside = [point for point in sweep.points if point.k[2:] == sweep.best.k[2:]]
    plane = Sweep(sweep.parameters, sweep.unit, tuple(sorted(inside, key=lambda point: point.k)))
    size = len({point.k[0] for point in plane.points})
    moduli = _moduli(plane)[:, :2].reshape(size, -1, 2)
    errors = np.array([np.nan if point.error is None else factor * point.error for point in plane.points])
    values = np.ma.masked_invalid(errors.reshape(size, -1))
    # far from the best the error says no more than that it is far
    top = min(float(values.max()), 3.0 * float(values.min()) + 1e-9)
    levels = np.linspace(float(values.min()), top, 13)
    filled = axes.contourf(moduli[..., 0], moduli[..., 1], values, levels=levels, cmap="viridis_r", extend="max")
    axes.contour(moduli[..., 0], moduli[..., 1], values, levels=levels[::2], colors="white", linewidths=0.5)
    solved = ~np.isnan(errors)
    flat = moduli.reshape(-1, 2)
    axes.scatter(flat[solved, 0], flat[solved, 1], s=3, color="0.3", linewidths=0, label="sweep")
    if not solved.all():
        axes.scatter(flat[~solved, 0], flat[~solved, 1], s=14, marker="x", color="0.3", label="no equilibrium")
    best = _moduli(Sweep(sweep.parameters, sweep.unit, (sweep.best,)))[0]
    axes.plot(best[0], best[1], "s", color=_BEST, markeredgecolor="white", markersize=10, label="best of the sweep")
    along, upwards = (estimated.get(tissue) for tissue in sweep.parameters.tissues[:2])
    if along is not None and upwards is not None:
        (x, *ends_x), (y, *ends_y) = along, upwards
        across = [[x - ends_x[0]], [ends_x[1] - x]], [[y - ends_y[0]], [ends_y[1] - y]]
        axes.errorbar(
            [x], [y], xerr=across[0], yerr=across[1], fmt="o", color=_ESTIMATE, markeredgecolor="white", capsize=4,
            markersize=8, label="estimate, 95 % intervals",
        )  # fmt: skip
    axes.set_xscale("log")
    axes.set_yscale("log")
    first, second = sweep.parameters.tissues[:2]
    axes.set_xlabel(f"shear modulus of {first} [Pa]")
    axes.set_ylabel(f"shear modulus of {second} [Pa]")
    figure.colorbar(filled, ax=axes, format="%.3g" if top > 1.1 * float(values.min()) else "%.4g").set_label(
        f"RMSE at the fitted recordings [{unit}]"
    )
