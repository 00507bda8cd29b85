"""Recordings beside a simulated state: the table that is printed, its JSON, and every row as CSV."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.atomic import whole_file
from warpbrain.cases.case import Case
from warpbrain.physics.words import tabled
from warpbrain.recordings.comparison import Comparison, Error
from warpbrain.recordings.recording import PointsRecording, SurfaceRecording
from warpbrain.report.explained import Explained, explained
from warpbrain.report.files import MILLIMETRES
from warpbrain.simulation.observation import Observed

#: Units as people read them, by that of a comparison, the factor and the name.
SHOWN = {"m": (MILLIMETRES, "mm")} | {unit: (1.0, unit) for unit in ("N", "Pa", "N m", "rad", "")}


def describe_comparisons(observed: Observed) -> dict[str, Any]:
    """Comparisons with units in their keys, and what could not be compared."""
    compared = [_describe(comparison) for comparison in observed.comparisons]
    return {
        "compared": compared,
        "in_words": list(explained_of(compared).sentences),
        "not_compared": list(observed.skipped),
    }


def explained_of(compared: Sequence[Mapping[str, Any]], what: str = "this simulation") -> Explained:
    """Whether a state explains what `describe_comparisons` compared it with."""
    numbers = [
        {**entry, "before": entry["before"]["root_mean_square"], "after": entry["after"]["root_mean_square"]}
        for entry in compared
    ]
    return explained(numbers, what)


def _describe(comparison: Comparison) -> dict[str, Any]:
    factor, unit = SHOWN[comparison.unit]

    def error(value: Error | None) -> dict[str, Any] | None:
        if value is None:
            return None
        said = {
            "root_mean_square": factor * value.root_mean_square,
            "percentile_95": factor * value.percentile_95,
            "largest": factor * value.largest,
        }
        return said if value.legacy is None else {**said, "legacy_sqrt_mm": value.legacy}

    said = {
        "name": comparison.name,
        "kind": comparison.kind,
        "role": comparison.role,
        "unit": unit,
        "count": comparison.count,
        "before": error(comparison.before),
        "after": error(comparison.after),
        "noise_root_mean_square": None if comparison.noise is None else factor * comparison.noise,
    }
    if comparison.reverse_before is not None:
        said["mesh_to_recording_before"] = error(comparison.reverse_before)
        said["mesh_to_recording_after"] = error(comparison.reverse_after)
    return said


def comparison_lines(said: Mapping[str, Any], legacy: bool) -> list[str]:
    """The table of errors, as printed."""
    lines = []
    if said["compared"]:
        lines.append(
            "RMSE at recordings       count   before    after    noise"
            + ("   legacy before    after [sqrt(mm)]" if legacy else "")
        )
    for entry in said["compared"]:
        ways = [(entry["name"], entry["before"], entry["after"])]
        if "mesh_to_recording_before" in entry:
            ways = [
                (f"{entry['name']} to mesh", entry["before"], entry["after"]),
                (f"mesh to {entry['name']}", entry["mesh_to_recording_before"], entry["mesh_to_recording_after"]),
            ]
        for number, (name, before, after) in enumerate(ways):
            noise = entry["noise_root_mean_square"] if number == 0 else None
            line = (
                f"  {name:<20} {entry['count'] if number == 0 else '':>7} {tabled(before['root_mean_square']):>8} "
                f"{tabled(after['root_mean_square']):>8} {'' if noise is None else tabled(noise):>8} {entry['unit']}"
            )
            if legacy and "legacy_sqrt_mm" in before:
                line += f" {before['legacy_sqrt_mm']:>13.3f} {after['legacy_sqrt_mm']:>8.3f}"
            lines.append(line + ("   check" if entry["role"] == "check" else ""))
    if said["compared"]:
        lines.append("  before: nothing moved; after: this simulation; noise: what the stated noise alone would leave")
        lines += [f"  {sentence}" for sentence in said["in_words"]]
    lines += [f"  not compared: {reason}" for reason in said["not_compared"]]
    return lines


def write_comparisons(path: Path, case: Case, observed: Observed) -> None:
    """Write every compared row: what was recorded, what was computed and the difference, in mm or N, axes RAS."""
    recordings = {recording.name: recording for recording in case.recordings}
    with whole_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as stream:
        rows = csv.writer(stream)
        rows.writerow(
            ["recording", "kind", "unit", "row", "id", "x_mm", "y_mm", "z_mm"]
            + [f"{what}_{axis}" for what in ("recorded", "computed", "difference") for axis in "xyz"]
        )
        for comparison in observed.comparisons:
            factor, unit = SHOWN[comparison.unit]
            recording = recordings[comparison.name]
            for k, row in enumerate(comparison.rows):
                place: Sequence[Any] = ("", "", "")
                if isinstance(recording, PointsRecording | SurfaceRecording):
                    place = _numbers(MILLIMETRES * recording.points[row])
                ids = recording.ids if isinstance(recording, PointsRecording) else None
                recorded = factor * comparison.residuals_before[k]
                difference = factor * comparison.residuals_after[k]
                if isinstance(
                    recording, SurfaceRecording
                ):  # unpaired: only the distance to the surface means something
                    recorded = np.full(3, np.nan)
                name = "" if ids is None else ids[row]
                numbers = [*_numbers(recorded), *_numbers(recorded - difference), *_numbers(difference)]
                rows.writerow([comparison.name, comparison.kind, unit, row, name, *place, *numbers])


def _numbers(values: Any) -> list[str]:
    return ["" if np.isnan(value) else f"{value:.6g}" for value in values]
