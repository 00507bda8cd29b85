"""Whether intervals of a model hold what they should, by method of measurement, and whether one model is better.

What is counted is a study or paper that was left out, not its points: the points of a curve, and the curves of a paper,
stand or fall together, and thousands of them are no more than thirty witnesses.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from warpbrain.gp.leaving_out import Score
from warpbrain.gp.literature.groups import METHODS
from warpbrain.gp.literature.study import Study

#: Central intervals that are looked at, and into how many equal parts the probability integral transform is counted.
INTERVALS = (0.5, 0.9, 0.95)
PARTS = 4


@dataclass(frozen=True)
class Calibration:
    """Of one model on the studies or papers of one method.

    Attributes
    ----------
    method : str
        "all" for all of them.
    count : int
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

    Attributes
    ----------
    other : str
    wins, count : int
        How often the first has the larger log predictive density.
    p_value : float
        Of the sign test: how often as uneven a count, or a more uneven one, comes of models that are equally good.
    difference, difference_error : float
        Mean of the paired differences and its standard error [nats a point].
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
    """Of a score with levels: one for each method that is there, and one of all.

    Parameters
    ----------
    score : Score
    methods : sequence of str
        Of each study or paper that was left out.
    """
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
