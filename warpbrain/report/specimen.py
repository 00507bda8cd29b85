"""Tests on a specimen beside their simulation: what is printed, its JSON, every row as CSV, and the picture.

The picture has one panel a test: over what was imposed, or over time, if the states of a test depend on its history.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.atomic import write_csv
from warpbrain.cases.case import Case
from warpbrain.cases.specimen import Specimen
from warpbrain.report import views
from warpbrain.report.files import MILLIMETRES, picked
from warpbrain.report.page import lines
from warpbrain.report.summary import describe_case
from warpbrain.report.views import BLACK, BLUE, VERMILLION
from warpbrain.simulation.locking import largest_poisson, locking_sentences
from warpbrain.simulation.model import Model
from warpbrain.simulation.specimen import SHOWN, Tested, interpolated

#: Colour and shape of recorded points by role; told apart by the colour-blind and without any colour.
_STYLES = {"fit": (BLUE, "o"), "check": (VERMILLION, "x")}
COLUMNS = 3


def describe_specimen(
    case: Case, specimen: Specimen, model: Model, in_time: bool, chosen: str | None
) -> dict[str, Any]:
    """Specimen and assumptions, with units; the keys of `describe_case` and those of the specimen.

    `in_time`: tests are followed through their times, since what acts has a memory or a ramp.
    """
    glued, plain = specimen.grips == "glued", model.elements == "tet4"
    instead = "a specimen has none that lock less"
    locking = locking_sentences(model.elements, largest_poisson(model), instead) if glued and not plain else []
    return {
        **describe_case(case, model, chosen),
        "specimen": {
            "shape": specimen.shape,
            "size_mm": [MILLIMETRES * length for length in specimen.size],
            "grips": specimen.grips,
        },
        "assumptions": [*lines("run.txt", "specimen_assumed", glued, in_time), *case.assumptions],
        "left_out": [*lines("run.txt", "specimen_left_out", in_time, glued and plain), *locking],
    }


def describe_tests(tests: Sequence[Tested]) -> list[dict[str, Any]]:
    """The computed curve of each test, with units."""
    described = []
    for recording, result in ((test.recording, test.result) for test in tests):
        quantity, answer = recording.quantities
        (factor, unit), (scale, answer_unit) = SHOWN[quantity], SHOWN[answer]
        described.append(
            {
                **picked(recording, "name", "mode", "role"),
                "rows": len(recording.imposed),
                **({} if result.time is None else {"time_s": result.time}),
                "imposed": {"quantity": quantity, "unit": unit, "values": factor * result.imposed},
                "response": {"quantity": answer, "unit": answer_unit, "values": scale * result.response},
                "newton_iterations": result.newton,
                "smallest_volume_ratio_J": result.min_J,
                "iterations_with_indefinite_tangent": result.unstable_iterations,
                "r_squared": result.r_squared,
            }
        )
    return described


def write_tests(path: Path, tests: Sequence[Tested]) -> None:
    """Write every row of every test: what was imposed, recorded and computed, and the difference."""
    head = ["recording", "mode", "role", "row", "t_s", "quantity", "imposed", "imposed_unit", "recorded", "computed"]
    rows: list[list[Any]] = [[*head, "difference", "unit"]]
    for test in tests:
        recording, result = test.recording, test.result
        quantity, controlled = recording.controlled
        factor, unit = SHOWN[quantity]
        # what answered is in the unit of its errors
        scale, answer_unit = SHOWN[recording.answer[0]]
        for row in test.comparison.rows.tolist():
            time = "" if recording.time is None else f"{recording.time[row]:.9g}"
            values = scale * np.array([recording.answer[1][row], result.predicted[row], result.residuals[row]])
            imposed = [quantity, f"{factor * controlled[row]:z.6g}", unit]
            head = [recording.name, recording.mode, recording.role, row, time]
            rows.append([*head, *imposed, *(f"{v:z.6g}" for v in values), answer_unit])
    write_csv(path, rows)


def tests_figure(tests: Sequence[Tested], most: int) -> Any:
    """Tests in up to so many columns."""
    columns = min(len(tests), most)
    rows = math.ceil(len(tests) / columns)
    width = 4.8 if most == 1 else 4.8 * max(columns, 2)
    figure, panels = views.panels(rows, columns, (width, 3.9 * rows + 1.1))
    for axes, test in zip(panels, tests, strict=False):
        _draw(axes, test)
    for axes in panels[len(tests) :]:
        axes.set_axis_off()
    roles = {test.recording.role for test in tests}
    entries = [
        (views.line(color=colour, marker=marker, linestyle=""), f"recorded, {role}")
        for role, (colour, marker) in _STYLES.items()
        if role in roles
    ]
    entries.append((views.line(color=BLACK, marker=".", linewidth=1.5), "simulated (dots: computed states)"))
    views.legend(figure, entries, loc="outside lower center", ncols=1 if most == 1 else 3, fontsize=9)
    return figure


def _draw(axes: Any, test: Tested) -> None:
    recording, result = test.recording, test.result
    (quantity, answer), (factor, unit) = recording.quantities, SHOWN[recording.quantities[0]]
    scale, answer_unit = _readable(recording.response, SHOWN[answer][1])
    colour, shape = _STYLES[recording.role]
    through_time = result.time is not None and recording.time is not None
    recorded_at = recording.time if through_time else factor * recording.imposed
    axes.plot(recorded_at, scale * recording.response, shape, color=colour, markersize=3.0, alpha=0.6)
    if result.time is not None:
        axes.plot(result.time, scale * result.response, ".-", color=BLACK, linewidth=1.5, markersize=6.0)
    else:
        line = np.linspace(result.imposed[0], result.imposed[-1], 200)
        curve = interpolated(result.imposed, result.response, line)
        axes.plot(factor * line, scale * curve, "-", color=BLACK, linewidth=1.5)
        axes.plot(factor * result.imposed, scale * result.response, ".", color=BLACK, markersize=6.0)
    axes.axhline(0.0, color="#bbbbbb", linewidth=0.7, zorder=0)
    axes.locator_params(axis="x", nbins=6)
    axes.set_xlabel("time [s]" if through_time else f"{quantity} [{unit}]" if unit else quantity)
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
