"""Tests on a specimen beside their simulation: what is printed, its JSON, and every row as CSV."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.atomic import whole_file
from warpbrain.cases.case import Case
from warpbrain.cases.specimen import Specimen
from warpbrain.recordings.recording import TestRecording
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.summary import describe_case, elements_lines
from warpbrain.simulation.locking import largest_poisson, locking_sentences
from warpbrain.simulation.model import Model
from warpbrain.simulation.specimen import SHOWN, TestResult
from warpbrain.simulation.specimen_run import Tested

#: How the grips hold a specimen, in words.
_GRIPS = {
    "glued": (
        "both ends are glued to rigid platens and cannot widen; the upper one moves as imposed: along the axis, or "
        "sideways or about the axis at constant height"
    ),
    "lubricated": (
        "both ends slide without friction on rigid platens: the state is homogeneous, nothing barrels or buckles"
    ),
}
_ELASTIC = (
    "the tissue is elastic and the test quasi-static: loading, unloading and every cycle run on one curve, and the "
    "specimen is free of stress at rest, where nothing is imposed"
)
_IN_TIME = (
    "the test is quasi-static and follows its recorded times, straight between the corners of its record; each begins "
    "with a rested specimen"
)
_RATE = "rate and history: relaxation, hysteresis, conditioning by earlier cycles"
_EARLIER = "conditioning by earlier cycles and tests"
_LEFT_OUT = (
    "flow of fluid through the tissue; weight and inertia of the specimen; prestrain from mounting it; slip and "
    "peeling at the grips"
)
#: Against meshes twice as fine and their extrapolation: neo-Hookean, 8 mm by 4.5 mm, and a cube.
_LOCKING = (
    "the linear tetrahedra make a glued specimen stiffer than it is: a cylinder of 8 mm by 4.5 mm at nu = 0.45 by 10 % "
    "axially, 9 % in torsion and 4 % in shear, at nu = 0.49 by 30 %, 28 % and 6 %; a cube by 6 % and by 8 % to 17 %"
)
#: Of `write_tests`.
_COLUMNS = (
    *("recording", "mode", "role", "row", "t_s", "quantity", "imposed", "imposed_unit"),
    *("recorded", "computed", "difference", "unit"),
)


def describe_specimen(
    case: Case, specimen: Specimen, model: Model, in_time: bool = False, chosen: str | None = None
) -> dict[str, Any]:
    """Specimen and assumptions, with units; the keys of `describe_case` and those of the specimen.

    `in_time`: tests are followed through their times, since what acts has a memory or a ramp.
    """
    if specimen.grips != "glued":
        locking = []
    elif model.elements == "tet4":
        locking = [_LOCKING]
    else:
        locking = locking_sentences(model.elements, largest_poisson(model), "a specimen has none that lock less")
    left_out = f"{_EARLIER if in_time else _RATE}; {_LEFT_OUT}"
    return {
        **describe_case(case, model, chosen),
        "specimen": {
            "shape": specimen.shape,
            "size_mm": [MILLIMETRES * length for length in specimen.size],
            "grips": specimen.grips,
        },
        "assumptions": [_GRIPS[specimen.grips], _IN_TIME if in_time else _ELASTIC, *case.assumptions],
        "left_out": [left_out, *locking],
    }


def specimen_lines(said: Mapping[str, Any]) -> list[str]:
    """The specimen and its assumptions, as printed."""
    specimen = said["specimen"]
    lines = [
        said["title"],
        f"  specimen  {_size(specimen)}, {said['volume_cm3']:.3g} cm3; ends {specimen['grips']}",
        f"  mesh      {said['nodes']} nodes, {said['tetrahedra']} tetrahedra"
        if specimen["grips"] == "glued"
        else "  mesh      one element: the state is homogeneous",
        *(elements_lines(said) if specimen["grips"] == "glued" else []),
    ]
    lines += [
        f"  tissue {label}  {tissue['name']}: {tissue['law']} ({tissue['formulation']}), "
        f"mu = {tissue['shear_modulus_Pa']:g} Pa, nu = {said['poisson']:g}"
        for label, tissue in said["tissues"].items()
    ]
    lines += [f"  assumed   {sentence}" for sentence in said["assumptions"]]
    lines += [f"  remark    {sentence}" for sentence in said["remarks"]]
    return lines + [f"  left out  {sentence}" for sentence in said["left_out"]]


def _size(specimen: Mapping[str, Any]) -> str:
    x, y, z = specimen["size_mm"]
    if specimen["shape"] == "cylinder":
        return f"cylinder, radius {x / 2.0:.4g} mm, height {z:.4g} mm"
    return f"block, {x:.4g} x {y:.4g} x {z:.4g} mm"


def describe_tests(tests: Sequence[Tested]) -> list[dict[str, Any]]:
    """The computed curve of each test, with units."""
    return [_describe(test.recording, test.result) for test in tests]


def _describe(recording: TestRecording, result: TestResult) -> dict[str, Any]:
    what, answer = recording.quantities
    (factor, unit), (scale, answer_unit) = SHOWN[what], SHOWN[answer]
    return {
        "name": recording.name,
        "mode": recording.mode,
        "role": recording.role,
        "rows": len(recording.imposed),
        **({} if result.time is None else {"time_s": result.time}),
        "imposed": {"quantity": what, "unit": unit, "values": factor * result.imposed},
        "response": {"quantity": answer, "unit": answer_unit, "values": scale * result.response},
        "newton_iterations": result.newton,
        "smallest_volume_ratio_J": result.min_J,
        "iterations_with_indefinite_tangent": result.unstable_iterations,
        "r_squared": result.r_squared,
    }


def tested_lines(tests: Sequence[Tested]) -> list[str]:
    """The table of tests, as printed."""
    lines = [
        "test                  mode       rows  role   RMSE before      after  unit       R2  states  Newton   min J"
    ]
    for test in tests:
        recording, result, compared = test.recording, test.result, test.comparison
        scale, unit = SHOWN[recording.answer[0]]
        before, after = (scale * error.root_mean_square for error in (compared.before, compared.after))
        lines.append(
            f"  {recording.name:<19} {recording.mode:<8} {compared.count:>6}  {recording.role:<5} "
            f"{before:>12.4g} {after:>10.4g}  {unit:<5} "
            f"{result.r_squared:>7.3f} {len(result.imposed):>7} {result.newton.sum():>7} {result.min_J.min():>7.3f}"
        )
        if result.unstable_iterations:
            lines.append(
                f"    note: the tangent was indefinite in {result.unstable_iterations} iterations: the specimen "
                "buckles or its law softens, and the real one may reach another state"
            )
    return [*lines, "  before: a specimen that resists nothing; after: this simulation; R2: 1 is perfect"]


def write_tests(path: Path, tests: Sequence[Tested]) -> None:
    """Write every row of every test: what was imposed, recorded and computed, and the difference."""
    with whole_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as stream:
        rows = csv.writer(stream)
        rows.writerow(_COLUMNS)
        for test in tests:
            recording, result = test.recording, test.result
            quantity, controlled = recording.controlled
            factor, unit = SHOWN[quantity]
            # what answered is in the unit of its errors
            scale, answer_unit = SHOWN[recording.answer[0]]
            head = [recording.name, recording.mode, recording.role]
            for row in test.comparison.rows.tolist():
                time = "" if recording.time is None else f"{recording.time[row]:.9g}"
                values = scale * np.array([recording.answer[1][row], result.predicted[row], result.residuals[row]])
                imposed = [quantity, f"{factor * controlled[row]:z.6g}", unit]
                rows.writerow([*head, row, time, *imposed, *(f"{v:z.6g}" for v in values), answer_unit])
