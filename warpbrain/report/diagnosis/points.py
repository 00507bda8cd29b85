"""Everything that was recorded beside what was computed of it, the table of the figures; its covariance."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.atomic import whole_file
from warpbrain.diagnosis.result import EXPLAINED, REFITTED, Diagnosis
from warpbrain.report.files import MILLIMETRES

#: Columns of `points.csv`; a number is a component of a point, a distance to a surface, or a component of a force.
COLUMNS = (
    *("recording", "point", "time_s", "unit", "x_mm", "y_mm", "z_mm", "direction_x", "direction_y", "direction_z"),
    *("observed", "declared", "refitted", "explained"),
    *("heldout_error_refitted", "heldout_error_explained", "set_aside"),
)


def write_points(path: Path, found: Diagnosis) -> None:
    """Write one row for each number that was recorded, lengths in mm, forces in N, axes RAS.

    `observed` is along `direction`; `declared`, `refitted` and `explained` are what was computed of it: in the case as
    declared, with its tissue refitted beside all that is no physics, and with what is named. A held-out error is what
    was observed less what is predicted without the point and those around it. What does not apply is empty.
    """
    sensors = found.base.declared.sensors
    observed = sensors.computed + sensors.residual
    nothing = np.full(len(sensors), np.nan)
    refitted = found.weighted_sets[REFITTED].best_residual
    explained = found.weighted_sets[EXPLAINED].best_residual if EXPLAINED in found.weighted_sets else nothing
    gross = found.gross
    factors = np.where(sensors.is_displacement, MILLIMETRES, 1.0)
    numbers = [
        factors * values
        for values in (
            observed,
            sensors.computed,
            observed - refitted,
            observed - explained,
            _held_out(found, REFITTED),
            _held_out(found, EXPLAINED),
        )
    ]
    times = np.where(np.isfinite(sensors.times), sensors.times, np.nan)
    with whole_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as stream:
        rows = csv.writer(stream)
        rows.writerow(COLUMNS)
        for k in range(len(sensors)):
            rows.writerow(
                [
                    sensors.names[sensors.recordings[k]],
                    sensors.groups[k],
                    _number(times[k]),
                    "mm" if sensors.is_displacement[k] else "N",
                    *(_number(MILLIMETRES * value) for value in sensors.positions[k]),
                    *(_number(value) for value in sensors.directions[k]),
                    *(_number(values[k]) for values in numbers),
                    int(gross[k]),
                ]
            )


def _held_out(found: Diagnosis, which: str) -> Floats:
    """Errors (n,) of displacements with a set of causes, NaN of all else."""
    if which not in found.held_out:
        return np.full(len(found.base.residual), np.nan)
    return np.where(found.base.at.sensors.is_displacement, found.held_out[which].errors, np.nan)


def _number(value: float) -> str:
    return "" if np.isnan(value) else f"{value:.6g}"


def write_covariance(path: Path, found: Diagnosis) -> None:
    """Write the `covariance` (n, n) of noise and nuisances, its rows those of `points.csv` in their units, mm and N.

    With `change` (n,) what an effect changes there, of displacements along `direction` (n, 3), the effect stands out by
    `sqrt(change @ solve(covariance, change))`. Walls have other normals than in the case as declared, which
    `points.csv` tells. Gross errors are in it with the noise that was declared, and all noise is as many
    times larger as was found.
    """
    base = found.base
    sensors = base.at.sensors
    without = found.weighted_sets[REFITTED].marginal
    noise = without.scale * without.model.noise_factor
    factors = np.where(sensors.is_displacement, MILLIMETRES, 1.0)[:, None]
    parts = factors * np.column_stack([noise, base.nuisances.columns])
    # half the digits: variances are a million times the least of them, not more
    covariance = (parts @ parts.T).astype(np.float32)
    with whole_file(path) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, covariance=covariance, direction=sensors.directions)
