"""Which model predicts studies it has not seen: leaving out one study, or all studies of one paper.

Ten rows of the literature are one paper's fits of one experiment with different formulas, twenty another's. Leaving out
one study leaves its siblings in, so that score says how well a model copies siblings; leaving out the paper says what a
model knows of the next laboratory, or the next patient. Where intervals are judged, studies or papers are counted and
not points: the points of a curve, and the curves of a paper, stand or fall together, and thousands of them are no more
than thirty witnesses.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.atomic import whole_file
from warpbrain.errors import InputError
from warpbrain.gp.candidates import POINTS, Candidate, Prediction
from warpbrain.gp.literature.study import METHODS, Study

Fold = Literal["study", "paper"]

#: Central intervals that are looked at, and into how many equal parts the probability integral transform is counted.
INTERVALS = (0.5, 0.9, 0.95)
PARTS = 4


@dataclass(frozen=True)
class Score:
    """Of one candidate on studies or papers that it was not fitted to; these count alike."""

    name: str
    log_density: float  # held-out log predictive density of a log energy [nats a point]
    log_density_error: float  # standard error of that over studies or papers
    rms_error: float  # root mean square of log energy minus its predicted mean
    coverage_50: float  # part of the points within the central interval of 50 %
    coverage_95: float
    values: tuple[float, ...]  # log density of each study or paper
    #: Probability integral transform of the level of each (`Candidate.level_pit`), evenly spread between 0 and 1 if the
    #: model is calibrated; empty where it was not computed.
    levels: tuple[float, ...] = ()

    @property
    def median(self) -> float:
        """Median of the log densities: one study that a model holds to be impossible does not decide it."""
        return float(np.median(self.values))


def folds(studies: Sequence[Study], fold: Fold) -> dict[str, list[Study]]:
    """What is left out together: each study by its name, or the studies of each paper by its."""
    held: dict[str, list[Study]] = {}
    for study in studies:
        held.setdefault(study.name if fold == "study" else study.paper, []).append(study)
    return held


def leave_out(
    candidate: Candidate,
    studies: Sequence[Study],
    fold: Fold,
    progress: Callable[[float], None] = lambda part: None,
) -> Score:
    """Score a candidate by leaving out each study, or each paper, in turn, and fitting it again without.

    `SolveError` if a covariance cannot be factored.
    """
    on_all = candidate.fitted(studies)
    held = folds(studies, fold)
    predictions: list[list[Prediction]] = []
    levels: list[float] = []
    for index, left_out in enumerate(held.values()):
        progress(index / len(held))
        without = on_all.fitted([study for study in studies if study not in left_out])
        predictions.append([without.predict(study, _seen(study)) for study in left_out])
        levels.append(without.level_pit(left_out, [_seen(study) for study in left_out]))
    values = np.array([np.mean([p.log_density.mean() for p in group]) for group in predictions])
    each = [np.mean([(p.error**2).mean() for p in group]) for group in predictions]
    within = [np.mean([np.mean(np.abs(p.pit - 0.5) < half) for g in predictions for p in g]) for half in (0.25, 0.475)]
    density = float(values.mean()), float(values.std(ddof=1) / np.sqrt(len(values)))
    points = float(np.sqrt(np.mean(each))), float(within[0]), float(within[1])
    return Score(candidate.name, *density, *points, tuple(values.tolist()), tuple(levels))


def _seen(study: Study) -> Floats:
    """Stretches at which a study is scored: at rest every energy is zero, which says nothing."""
    grid = study.grid(POINTS)
    return grid[np.abs(grid - 1.0) > 1e-9]


@dataclass(frozen=True)
class Calibration:
    """Of one model on the studies or papers of one method, "all" for all of them."""

    method: str
    count: int
    within: tuple[int, ...]  # how many have their level within each of `INTERVALS`
    #: 95 % interval (Clopper and Pearson 1934) of the part that each of these intervals holds.
    ranges: tuple[tuple[float, float], ...]
    #: Probability integral transforms in `PARTS` equal parts of 0 to 1: even if the model is calibrated, a hill if its
    #: intervals are too wide, a valley if too narrow.
    histogram: tuple[int, ...]


@dataclass(frozen=True)
class Comparison:
    """Of one model with another, study by study or paper by paper.

    `wins` says how often the first has the larger log predictive density, `p_value` is that of the sign test: how often
    as uneven a count, or a more uneven one, comes of models that are equally good. `difference` is the mean of the
    paired differences with its standard error [nats a point].
    """

    other: str
    wins: int
    count: int
    p_value: float
    difference: float
    difference_error: float


def methods_of(held: Mapping[str, Sequence[Study]]) -> list[str]:
    """The method of what was left out together, by the order of `held`; no paper of the literature has two."""
    return [
        " and ".join(dict.fromkeys(study.group.partition("/")[0] for study in left_out)) for left_out in held.values()
    ]


def calibration(score: Score, methods: Sequence[str]) -> list[Calibration]:
    """Of a score with levels: one for each of the methods of what was left out, and one of all."""
    from scipy.stats import binomtest

    levels, names = np.array(score.levels), np.array(methods)
    calibrations = []
    for method in (*(name for name in dict.fromkeys((*METHODS, *methods)) if name in methods), "all"):
        of_method = levels if method == "all" else levels[names == method]
        count = len(of_method)
        within = tuple(int(np.sum(np.abs(of_method - 0.5) <= 0.5 * part)) for part in INTERVALS)
        intervals = (binomtest(hits, count).proportion_ci(0.95, "exact") for hits in within)
        ranges = tuple((float(interval.low), float(interval.high)) for interval in intervals)
        histogram = np.histogram(of_method, PARTS, (0.0, 1.0))[0]
        calibrations.append(Calibration(method, count, within, ranges, tuple(histogram.tolist())))
    return calibrations


def compared(score: Score, other: Score) -> Comparison:
    """A model against another on the same studies or papers; ties count for neither."""
    from scipy.stats import binomtest

    away = np.array(score.values) - np.array(other.values)
    wins, count = int(np.sum(away > 0.0)), int(np.sum(away != 0.0))
    p_value = float(binomtest(wins, count).pvalue) if count else 1.0
    error = float(away.std(ddof=1) / np.sqrt(len(away))) if len(away) > 1 else float("nan")
    return Comparison(other.name, wins, count, p_value, float(away.mean()), error)


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

    Files written before levels were scored have none, nor have their scores. `InputError` if it is not such a file, or
    is of other studies.
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


def calibration_lines(calibrations: Sequence[Calibration], left: str) -> list[str]:
    """The table of one model for the terminal: hits and what part of hits they are compatible with."""
    heads = "".join(f"{f'{100 * part:g} % interval':>24}" for part in INTERVALS)
    lines = [f"{'method':<14}{left + 's':>8}{heads}   {left + 's by probability, lowest quarter first':>}"]
    for of in calibrations:
        cells = ""
        for hits, (low, high) in zip(of.within, of.ranges, strict=True):
            cells += f"{hits:8d}: {100 * hits / of.count:3.0f} % ({100 * low:.0f} to {100 * high:.0f})".rjust(24)
        lines.append(f"{of.method:<14}{of.count:>8}{cells}   {' '.join(map(str, of.histogram))}")
    return lines


def comparison_lines(name: str, comparisons: Sequence[Comparison]) -> list[str]:
    """One model against the others for the terminal."""
    width = max(len(comparison.other) for comparison in comparisons)
    lines = [f"{name} against:".ljust(width + 2) + "   ahead in   sign test p   difference of log density a point"]
    for comparison in comparisons:
        ahead = f"{comparison.wins} of {comparison.count}"
        difference = f"{comparison.difference:8.2f} +- {comparison.difference_error:.2f}"
        lines.append(f"  {comparison.other:{width}}{ahead:>11}{comparison.p_value:>14.2g}   {difference}")
    return lines
