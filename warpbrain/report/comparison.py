"""Recordings beside a simulated state: errors as a table and as JSON, every row as CSV, whether the state explains
them better than nothing at all would, and what of the errors is likely to be the mesh's."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.atomic import write_csv
from warpbrain.cases.case import Case
from warpbrain.physics.words import tabled
from warpbrain.recordings.comparison import Comparison
from warpbrain.recordings.recording import PointsRecording, SurfaceRecording
from warpbrain.report.files import MILLIMETRES, picked
from warpbrain.report.page import lines
from warpbrain.simulation.mesh_error import MeshError
from warpbrain.simulation.observation import Observed

#: Units as people read them, by that of a comparison, the factor and the name.
SHOWN = {"m": (MILLIMETRES, "mm")} | {unit: (1.0, unit) for unit in ("N", "Pa", "N m", "rad", "")}
WORSE, IN_PART, NO_NEARER, NEARER, UNKNOWN = (
    "worse than no motion at all", "in part worse than no motion", "no nearer than no motion", "nearer than no motion",
    "not compared",
)  # fmt: skip


def error_text(value: float, unit: str) -> str:
    """An error as people read it: micrometres of lengths, three digits of what has any size."""
    return tabled(value) if unit == "mm" else f"{value:.3g}"


def describe_comparisons(observed: Observed) -> dict[str, Any]:
    """Comparisons with units in their keys, and what could not be compared."""
    compared = [_describe(comparison) for comparison in observed.comparisons]
    return {
        "compared": compared,
        "in_words": list(explained_of(compared).sentences),
        "not_compared": list(observed.skipped),
    }


def _describe(comparison: Comparison) -> dict[str, Any]:
    factor, unit = SHOWN[comparison.unit]

    def error(value: Any) -> dict[str, Any]:
        sizes = {key: factor * getattr(value, key) for key in ("root_mean_square", "percentile_95", "largest")}
        return sizes if value.legacy is None else {**sizes, "legacy_sqrt_mm": value.legacy}

    described = {
        **picked(comparison, "name", "kind", "role"),
        "unit": unit,
        "count": comparison.count,
        "before": error(comparison.before),
        "after": error(comparison.after),
        "noise_root_mean_square": None if comparison.noise is None else factor * comparison.noise,
    }
    if comparison.reverse_before is not None:
        described["mesh_to_recording_before"] = error(comparison.reverse_before)
        described["mesh_to_recording_after"] = error(comparison.reverse_after)
    return described


def recorded_rows(compared: Sequence[Mapping[str, Any]]) -> list[list[Any]]:
    """The table of errors: recording, rows, root mean square with nothing moved and here, 95th percentile and largest
    here, what noise alone leaves, unit, whether it is only checked, and the paper's own error before and after.

    Of a surface there is a second row, from the mesh to what was recorded.
    """
    rows = []
    for entry in compared:
        noise, unit = entry["noise_root_mean_square"], entry["unit"]
        left = "" if noise is None else error_text(noise, unit)
        directions = [(entry["name"], entry["count"], "", left)]
        if "mesh_to_recording_before" in entry:
            directions = [
                (f"{entry['name']} to mesh", entry["count"], "", left),
                (f"mesh to {entry['name']}", "", "mesh_to_recording_", ""),
            ]
        for name, count, key, left in directions:
            before, after = entry[f"{key}before"], entry[f"{key}after"]
            errors = (before["root_mean_square"], *(after[k] for k in ("root_mean_square", "percentile_95", "largest")))
            legacy = (error.get("legacy_sqrt_mm") for error in (before, after))
            check = "check" if entry["role"] == "check" else ""
            rows.append([name, count, *(error_text(value, unit) for value in errors), left, unit, check, *legacy])
    return rows


def write_comparisons(path: Path, case: Case, observed: Observed) -> None:
    """Write every compared row: what was recorded, what was computed and the difference, in mm or N, axes RAS."""
    vectors = [f"{quantity}_{axis}" for quantity in ("recorded", "computed", "difference") for axis in "xyz"]
    rows = [["recording", "kind", "unit", "row", "id", "x_mm", "y_mm", "z_mm", *vectors]]
    recordings = {recording.name: recording for recording in case.recordings}
    for comparison in observed.comparisons:
        factor, unit = SHOWN[comparison.unit]
        recording = recordings[comparison.name]
        for k, row in enumerate(comparison.rows):
            place: Sequence[Any] = ("", "", "")
            if isinstance(recording, PointsRecording | SurfaceRecording):
                place = _numbers(MILLIMETRES * recording.points[row])
            ids = recording.ids if isinstance(recording, PointsRecording) else None
            recorded, difference = factor * comparison.residuals_before[k], factor * comparison.residuals_after[k]
            if isinstance(recording, SurfaceRecording):
                # unpaired: only the distance to the surface means something
                recorded = np.full(3, np.nan)
            numbers = [*_numbers(recorded), *_numbers(recorded - difference), *_numbers(difference)]
            head = [comparison.name, comparison.kind, unit, row, "" if ids is None else ids[row]]
            rows.append([*head, *place, *numbers])
    write_csv(path, rows)


def _numbers(values: Any) -> list[str]:
    return ["" if np.isnan(value) else f"{value:.6g}" for value in values]


@dataclass(frozen=True)
class Explained:
    """How a state compares with doing nothing."""

    #: One of `WORSE`, `IN_PART`, `NO_NEARER`, `NEARER` and `UNKNOWN`, of lengths; of other units alone, `UNKNOWN`.
    verdict: str
    #: Root mean square over all rows in mm, with nothing moved and with the state.
    before: float | None
    after: float | None
    #: Of all lengths together, and of each recording to which nothing is nearer than the state.
    sentences: tuple[str, ...]


def explained_of(compared: Sequence[dict[str, Any]]) -> Explained:
    """Whether a simulation explains what `describe_comparisons` compared it with."""
    return explained([each | {key: each[key]["root_mean_square"] for key in ("before", "after")} for each in compared])


def explained(entries: Sequence[Mapping[str, Any]], what: str = "this simulation") -> Explained:
    """Judge a state, which sentences call `what`, by its comparisons.

    Of each recording they have ``name``, ``unit``, ``count``, and root mean squares ``before`` and ``after`` in that
    unit.
    """
    lengths = [entry for entry in entries if entry["unit"] == "mm" and entry["count"]]
    count = sum(entry["count"] for entry in lengths)
    before, after = (
        math.sqrt(sum(entry["count"] * entry[key] ** 2 for entry in lengths) / count) if count else None
        for key in ("before", "after")
    )
    worse = [entry for entry in entries if entry["after"] > entry["before"]]
    sentences = lines("run.txt", "worse", worse, error_text)
    if before is None or after is None:
        return Explained(UNKNOWN, before, after, tuple(sentences))
    # whole per cent of the error of no motion that are gone
    gone = round(100.0 * (1.0 - after / before)) if before > 0.0 else 0
    verdict = WORSE if after > before else IN_PART if worse else NEARER if gone else NO_NEARER
    return Explained(verdict, before, after, (*lines("run.txt", "explained", what, before, after, gone), *sentences))


def describe_mesh_error(error: MeshError, elements: str, observed: Observed, without: Observed) -> dict[str, Any]:
    """The estimate with units, for elements of a run.

    `observed` is recordings beside the state, `without` beside the state with the estimated error taken off.
    """
    references, linear = [], elements == "tet4"
    if linear:
        references.append("elements of averaged gradients on the same mesh, which lock less")
    if error.size is not None:
        references.append(
            "such elements of half the size, whose difference is taken for three quarters of what is left"
        )
    recordings = [
        {
            "name": here.name,
            "unit": SHOWN[here.unit][1],
            **_sizes(np.nan_to_num(there.residuals_after - here.residuals_after), SHOWN[here.unit][0]),
            "root_mean_square_after": SHOWN[here.unit][0] * here.after.root_mean_square,
            "root_mean_square_without_it": SHOWN[here.unit][0] * there.after.root_mean_square,
        }
        for here, there in zip(observed.comparisons, without.comparisons, strict=True)
    ]
    return {
        "how": f"compared with {' and '.join(references)}",
        "displacement_mm": _sizes(error.u, MILLIMETRES),
        "locking_mm": _sizes(error.locking, MILLIMETRES) if linear else None,
        "element_size_mm": None if error.size is None else _sizes(error.size, MILLIMETRES),
        "locking_share": error.locking_share if linear and error.size is not None else None,
        "recordings": recordings,
    }


def _sizes(vectors: Floats, factor: float) -> dict[str, float]:
    lengths = factor * np.linalg.norm(vectors, axis=1)
    high = float(np.percentile(lengths, 95.0))
    return {"median": float(np.median(lengths)), "percentile_95": high, "largest": float(lengths.max())}
