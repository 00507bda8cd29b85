"""The table of scores of models on studies that they have not seen: a CSV file that grows line by line."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

from warpbrain.atomic import whole_file
from warpbrain.errors import InputError
from warpbrain.gp.leaving_out import Score

#: Columns before the log density of each study or paper.
COLUMNS = ("model", "log density [nats a point]", "standard error", "median", "rms error", "within 50 %", "within 95 %")


def write_scores(path: Path, scores: Sequence[Score], held: Sequence[str]) -> None:
    """Write scores, a line a model, with the log density of each study or paper that was left out."""
    with whole_file(path) as unfinished, unfinished.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([*COLUMNS, *held])
        for score in scores:
            writer.writerow([score.name, *(repr(value) for value in score.numbers), *map(repr, score.values)])


def read_scores(path: Path, held: Sequence[str]) -> list[Score]:
    """Scores of a file that an interrupted comparison left; none if there is no file.

    Raises
    ------
    InputError
        If it is not such a file, or is of other studies.
    """
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))
    if not rows or rows[0] != [*COLUMNS, *held]:
        raise InputError(f"{path}: not a comparison of these studies: take the file away to begin again")
    scores = []
    for line, row in enumerate(rows[1:], 2):
        try:
            numbers = [float(value) for value in row[1:]]
            mean, error, _, rms, half, most = numbers[:6]
            scores.append(Score(row[0], mean, error, rms, half, most, tuple(numbers[6:])))
        except (ValueError, IndexError):
            raise InputError(f"{path}: line {line}: cannot be read: take the file away to begin again") from None
    return scores


def score_lines(scores: Sequence[Score]) -> list[str]:
    """The table for the terminal."""
    width = max(len(score.name) for score in scores)
    lines = [f"{'':{width}}  log density (median) [nats a point]   rms error   within 50 %   95 %"]
    for score in scores:
        density = f"{score.log_density:8.2f} +- {score.log_density_error:<6.2f} ({score.median:6.2f})"
        within = f"{100 * score.coverage_50:10.0f} %  {100 * score.coverage_95:3.0f} %"
        lines.append(f"{score.name:{width}}  {density}       {score.rms_error:8.2f}  {within}")
    return lines
