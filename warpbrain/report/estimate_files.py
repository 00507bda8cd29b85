"""Every recorded row beside what an estimate makes of it, as CSV."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from warpbrain.atomic import whole_file
from warpbrain.estimation.posterior import Posterior
from warpbrain.estimation.prediction import Prediction
from warpbrain.recordings.recording import PointsRecording, Recording, SurfaceRecording
from warpbrain.report.comparison import SHOWN
from warpbrain.report.files import MILLIMETRES

_HEADER = (
    *("recording", "kind", "role", "unit", "row", "gross_error", "x_mm", "y_mm", "z_mm"),
    *(f"{what}_{axis}" for what in ("observed", "predicted", "standard_deviation") for axis in "xyz"),
)


def write_predictions(path: Path, posterior: Posterior) -> None:
    """Write every row, in mm or N, axes RAS; of a surface the distance stands in the first of three components."""
    recordings = {recording.name: recording for recording in posterior.case.recordings}
    with whole_file(path) as unfinished, unfinished.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(_HEADER)
        for prediction in posterior.predictions:
            for number in range(len(prediction.rows)):
                writer.writerow(_row(prediction, recordings[prediction.name], number))


def _row(prediction: Prediction, recording: Recording, number: int) -> list[object]:
    factor, unit = SHOWN[prediction.unit]
    row = int(prediction.rows[number])
    place = [""] * 3
    if isinstance(recording, PointsRecording | SurfaceRecording):
        place = [f"{MILLIMETRES * value:.6g}" for value in recording.points[row]]
    before, after = prediction.before[number], prediction.after[number]
    numbers: list[str] = []
    for values in (before, before - after, prediction.deviation[number]):
        shown = [f"{factor * value:.6g}" for value in np.atleast_1d(values)]
        numbers += shown + [""] * (3 - len(shown))
    head = [prediction.name, prediction.kind, prediction.role, unit, row, int(prediction.gross[number])]
    return [*head, *place, *numbers]
