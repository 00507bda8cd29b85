"""Which model predicts studies it has not seen: leaving out one study, or all studies of one paper.

Ten rows of the literature are one paper's fits of one experiment with different formulas, twenty another's. Leaving out
one study leaves its siblings in, so that score says how well a model copies siblings; leaving out the paper says what a
model knows of the next laboratory, or the next patient. Where intervals are judged, studies or papers are counted and
not points: the points of a curve, and the curves of a paper, stand or fall together, and thousands of them are no more
than thirty witnesses.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.gp.candidates import POINTS, Candidate, Prediction
from warpbrain.gp.literature.study import METHODS, Study

Fold = Literal["study", "paper"]

#: Central intervals that are looked at, and into how many equal parts the probability integral transform is counted.
INTERVALS = (0.5, 0.9, 0.95)
PARTS = 4


@dataclass(frozen=True)
class Score:
    """Of one candidate on studies or papers that it was not fitted to; these count alike.

    Attributes
    ----------
    log_density, log_density_error : float
        Held-out log predictive density of a log energy [nats a point], and its standard error over studies or papers.
    rms_error : float
        Root mean square of log energy minus its predicted mean.
    coverage_50, coverage_95 : float
        Part of the points within the central intervals of 50 % and 95 %.
    values, levels : tuple of float
        Log density of each study or paper, and probability integral transform of its level (`Candidate.level_pit`),
        evenly spread between 0 and 1 if the model is calibrated; empty where it was not computed.
    """

    name: str
    log_density: float
    log_density_error: float
    rms_error: float
    coverage_50: float
    coverage_95: float
    values: tuple[float, ...]
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

    Raises
    ------
    SolveError
        If a covariance cannot be factored.
    """
    whole = candidate.fitted(studies)
    held = folds(studies, fold)
    predictions: list[list[Prediction]] = []
    levels: list[float] = []
    for index, left in enumerate(held.values()):
        progress(index / len(held))
        without = whole.fitted([study for study in studies if study not in left])
        predictions.append([without.predict(study, _seen(study)) for study in left])
        levels.append(without.level_pit(left, [_seen(study) for study in left]))
    values = np.array([np.mean([p.log_density.mean() for p in group]) for group in predictions])
    each = [np.mean([(p.error**2).mean() for p in group]) for group in predictions]
    within = [np.mean([np.mean(np.abs(p.pit - 0.5) < half) for g in predictions for p in g]) for half in (0.25, 0.475)]
    error = float(values.std(ddof=1) / np.sqrt(len(values)))
    return Score(
        candidate.name,
        float(values.mean()),
        error,
        float(np.sqrt(np.mean(each))),
        float(within[0]),
        float(within[1]),
        tuple(values.tolist()),
        tuple(levels),
    )


def _seen(study: Study) -> Floats:
    """Stretches at which a study is scored: at rest every energy is zero, which says nothing."""
    grid = study.grid(POINTS)
    return grid[np.abs(grid - 1.0) > 1e-9]


@dataclass(frozen=True)
class Calibration:
    """Of one model on the studies or papers of one method, "all" for all of them.

    Attributes
    ----------
    within : tuple of int
        How many have their level within each of `INTERVALS`.
    ranges : tuple of (float, float)
        95 % interval (Clopper and Pearson 1934) of the part that each of these intervals holds.
    histogram : tuple of int
        Probability integral transforms in `PARTS` equal parts of 0 to 1: even if the model is calibrated, a hill if its
        intervals are too wide, a valley if too narrow.
    """

    method: str
    count: int
    within: tuple[int, ...]
    ranges: tuple[tuple[float, float], ...]
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
    return [" and ".join(dict.fromkeys(study.group.partition("/")[0] for study in left)) for left in held.values()]


def calibration(score: Score, methods: Sequence[str]) -> list[Calibration]:
    """Of a score with levels: one for each of the methods of what was left out, and one of all."""
    from scipy.stats import binomtest

    levels, names = np.array(score.levels), np.array(methods)
    found = []
    for method in (*(name for name in dict.fromkeys((*METHODS, *methods)) if name in methods), "all"):
        own = levels if method == "all" else levels[names == method]
        within = [int(np.sum(np.abs(own - 0.5) <= 0.5 * part)) for part in INTERVALS]
        ranges = [binomtest(hits, len(own)).proportion_ci(0.95, "exact") for hits in within]
        histogram = np.histogram(own, PARTS, (0.0, 1.0))[0]
        found.append(
            Calibration(
                method,
                len(own),
                tuple(within),
                tuple((float(one.low), float(one.high)) for one in ranges),
                tuple(histogram.tolist()),
            )
        )
    return found


def compared(score: Score, other: Score) -> Comparison:
    """A model against another on the same studies or papers; ties count for neither."""
    from scipy.stats import binomtest

    away = np.array(score.values) - np.array(other.values)
    wins, count = int(np.sum(away > 0.0)), int(np.sum(away != 0.0))
    p_value = float(binomtest(wins, count).pvalue) if count else 1.0
    error = float(away.std(ddof=1) / np.sqrt(len(away))) if len(away) > 1 else float("nan")
    return Comparison(other.name, wins, count, p_value, float(away.mean()), error)
