"""The picture of a specimen's tests: what was recorded and what was simulated, one panel a test.

Over what was imposed; over time, if the states of a test depend on its history.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.report import views
from warpbrain.simulation.specimen import SHOWN, interpolated
from warpbrain.simulation.specimen_run import Tested

#: Colour and shape of recorded points by role; told apart by the colour-blind and without any colour.
_STYLES = {"fit": ("#0072b2", "o"), "check": ("#d55e00", "x")}
_SIMULATED = "#000000"
COLUMNS = 3


def write_tests_picture(path: Path, tests: Sequence[Tested], title: str, subtitle: str) -> None:
    """Draw tests.

    Parameters
    ----------
    path : Path
        PNG file.
    tests : sequence of Tested
        At least one.
    title, subtitle : str
    """
    figure = tests_figure(tests, COLUMNS)
    # the title is the user's free text, in which a dollar sign begins no formula
    figure.suptitle(f"{title}\n{subtitle}", fontsize=12, parse_math=False)
    views.save(figure, path)


def tests_figure(tests: Sequence[Tested], most: int) -> Any:
    """Tests in up to so many columns."""
    from matplotlib.figure import Figure

    columns = min(len(tests), most)
    rows = math.ceil(len(tests) / columns)
    width = 4.8 if most == 1 else 4.8 * max(columns, 2)
    figure = Figure(figsize=(width, 3.9 * rows + 1.1), layout="constrained", facecolor="white")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, test in zip(panels, tests, strict=False):
        _draw(axes, test)
    for axes in panels[len(tests) :]:
        axes.set_axis_off()
    _draw_legend(figure, {test.recording.role for test in tests}, 1 if most == 1 else 3)
    return figure


def _draw(axes: Any, test: Tested) -> None:
    recording, result = test.recording, test.result
    (what, answer), (factor, unit) = recording.quantities, SHOWN[recording.quantities[0]]
    scale, answer_unit = _readable(recording.response, SHOWN[answer][1])
    colour, shape = _STYLES[recording.role]
    through_time = result.time is not None and recording.time is not None
    recorded_at = recording.time if through_time else factor * recording.imposed
    axes.plot(recorded_at, scale * recording.response, shape, color=colour, markersize=3.0, alpha=0.6)
    if result.time is not None:
        axes.plot(result.time, scale * result.response, ".-", color=_SIMULATED, linewidth=1.5, markersize=6.0)
    else:
        line = np.linspace(result.imposed[0], result.imposed[-1], 200)
        curve = interpolated(result.imposed, result.response, line)
        axes.plot(factor * line, scale * curve, "-", color=_SIMULATED, linewidth=1.5)
        axes.plot(factor * result.imposed, scale * result.response, ".", color=_SIMULATED, markersize=6.0)
    axes.axhline(0.0, color="#bbbbbb", linewidth=0.7, zorder=0)
    axes.locator_params(axis="x", nbins=6)
    axes.set_xlabel("time [s]" if through_time else f"{what} [{unit}]" if unit else what)
    axes.set_ylabel(f"{'nominal ' if answer == 'stress' else ''}{answer} [{answer_unit}]")
    error = f"{scale * test.comparison.after.root_mean_square:.3g} {answer_unit}"
    if recording.force_controlled:
        error = f"{factor * test.comparison.after.root_mean_square:.3g} {unit}".rstrip()
    heading = f"{recording.name}: {recording.mode}, {recording.role}; RMSE {error}"
    axes.set_title(heading, fontsize=10, parse_math=False)


def _readable(response: Floats, unit: str) -> tuple[float, str]:
    """Factor and unit in which a response has few zeros: thousandths, thousands, or as it is."""
    largest = float(np.abs(response).max())
    if unit == "Pa":
        return (1e-3, "kPa") if largest >= 1000.0 else (1.0, unit)
    if largest == 0.0 or largest >= 1.0:
        return 1.0, unit
    return (1e3, f"m{unit}") if largest >= 1e-3 else (1e6, f"µ{unit}")


def _draw_legend(figure: Any, roles: set[str], columns: int) -> None:
    from matplotlib.lines import Line2D

    entries: list[tuple[Any, str]] = [
        (Line2D([], [], color=_STYLES[role][0], marker=_STYLES[role][1], linestyle=""), f"recorded, {role}")
        for role in _STYLES
        if role in roles
    ]
    entries.append((Line2D([], [], color=_SIMULATED, marker=".", linewidth=1.5), "simulated (dots: computed states)"))
    views.legend(figure, entries, loc="outside lower center", ncols=columns, fontsize=9)
