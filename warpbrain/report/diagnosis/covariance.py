"""How what was recorded may differ from what is computed where no physics is missing, for effects that users bring."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from warpbrain.atomic import whole_file
from warpbrain.diagnosis.result import REFITTED, Diagnosis
from warpbrain.report.files import MILLIMETRES


def write_covariance(path: Path, found: Diagnosis) -> None:
    """Write the `covariance` (n, n) of noise and nuisances, its rows those of `points.csv` in their units, mm and N.

    With `change` (n,) what an effect changes there, of displacements along `direction` (n, 3), the effect stands out by
    `sqrt(change @ solve(covariance, change))`. Walls have other normals than in the case as declared, which
    `points.csv` tells. Gross errors are in it with the noise that was declared, and all noise is as many
    times larger as was found.
    """
    base = found.base
    sensors = base.at.sensors
    noise = found.weighted_sets[REFITTED].marginal.scale * base.model.noise_factor
    factors = np.where(sensors.is_displacement, MILLIMETRES, 1.0)[:, None]
    parts = factors * np.column_stack([noise, base.nuisances.columns])
    # half the digits: variances are a million times the least of them, not more
    covariance = (parts @ parts.T).astype(np.float32)
    with whole_file(path) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, covariance=covariance, direction=sensors.directions)
