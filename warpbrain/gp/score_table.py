"""The table of scores of models on studies that they have not seen: a CSV file that grows line by line."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

from warpbrain.atomic import whole_file
from warpbrain.errors import InputError
from warpbrain.gp.leaving_out import INTERVALS, Calibration, Comparison, Score

#: Columns before the log density of each study or paper.
COLUMNS = ("model", "log density [nats a point]", "standard error", "median", "rms error", "within 50 %", "within 95 %")


def write_scores(path: Path, scores: Sequence[Score], held: Sequence[str]) -> None:
    """Write scores, a line a model, with log density and level of each study or paper that was left out."""
    with whole_file(path) as unfinished, unfinished.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([*COLUMNS, *held, *_level_columns(held)])
        for score in scores:
            density = score.log_density, score.log_density_error, score.median
            points = score.rms_error, score.coverage_50, score.coverage_95
            writer.writerow([score.name, *map(repr, (*density, *points, *score.values, *score.levels))])


def read_scores(path: Path, held: Sequence[str]) -> list[Score]:
    """Scores of a file that an interrupted comparison left; none if there is no file.

    Files written before levels were scored have none, nor have their scores.

    Raises
    ------
    InputError
        If it is not such a file, or is of other studies.
    """
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))
    known = [*COLUMNS, *held]
    if not rows or rows[0] not in (known, [*known, *_level_columns(held)]):
        raise InputError(f"{path}: not a comparison of these studies: take the file away to begin again")
    scores = []
    for line, row in enumerate(rows[1:], 2):
        try:
            numbers = [float(value) for value in row[1:]]
            mean, error, _, rms, half, most = numbers[:6]
            values, levels = tuple(numbers[6 : 6 + len(held)]), tuple(numbers[6 + len(held) :])
            if len(values) != len(held) or len(levels) not in (0, len(held)):
                raise ValueError
            scores.append(Score(row[0], mean, error, rms, half, most, values, levels))
        except (ValueError, IndexError):
            raise InputError(f"{path}: line {line}: cannot be read: take the file away to begin again") from None
    return scores


def _level_columns(held: Sequence[str]) -> list[str]:
    return [f"level of {name}" for name in held]


def score_lines(scores: Sequence[Score]) -> list[str]:
    """The table for the terminal."""
    width = max(len(score.name) for score in scores)
    lines = [f"{'':{width}}  log density a point (median)        rms error   within 50 %   95 %"]
    for score in scores:
        density = f"{score.log_density:8.2f} +- {score.log_density_error:<6.2f} ({score.median:6.2f})"
        within = f"{100 * score.coverage_50:10.0f} %  {100 * score.coverage_95:3.0f} %"
        lines.append(f"{score.name:{width}}  {density}       {score.rms_error:8.2f}  {within}")
    return lines


def calibration_lines(found: Sequence[Calibration], left: str) -> list[str]:
    """The table of one model for the terminal: hits and what part of hits they are compatible with."""
    heads = "".join(f"{f'{100 * part:g} % interval':>24}" for part in INTERVALS)
    lines = [f"{'method':<14}{left + 's':>8}{heads}   {left + 's by probability, lowest quarter first':>}"]
    for one in found:
        cells = ""
        for hits, (low, high) in zip(one.within, one.ranges, strict=True):
            cells += f"{hits:8d}: {100 * hits / one.count:3.0f} % ({100 * low:.0f} to {100 * high:.0f})".rjust(24)
        lines.append(f"{one.method:<14}{one.count:>8}{cells}   {' '.join(map(str, one.histogram))}")
    return lines


def comparison_lines(name: str, found: Sequence[Comparison]) -> list[str]:
    """One model against the others for the terminal."""
    width = max(len(one.other) for one in found)
    lines = [f"{name} against:".ljust(width + 2) + "   ahead in   sign test p   difference of log density a point"]
    for one in found:
        ahead = f"{one.wins} of {one.count}"
        difference = f"{one.difference:8.2f} +- {one.difference_error:.2f}"
        lines.append(f"  {one.other:{width}}{ahead:>11}{one.p_value:>14.2g}   {difference}")
    return lines
