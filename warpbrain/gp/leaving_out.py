"""Which model predicts studies it has not seen: leaving out one study, or all studies of one paper.

Ten rows of the literature are one paper's fits of one experiment with different formulas, twenty another's. Leaving out
one study leaves its siblings in, so that score says how well a model copies siblings; leaving out the paper says what a
model knows of the next laboratory, or the next patient. Where intervals are judged, studies or papers are counted and
not points: the points of a curve, and the curves of a paper, stand or fall together, and thousands of them are no more
than thirty witnesses.

Every candidate predicts the log energies `y = ln(Psi + 1e-4)` of a study of a group, at any stretch, one by one. The
coregionalised ones learn from 20 points a study here, not 100, so that each can be trained again for every study that
is left out; each training goes on from the one on all studies. A group of which the only study is left out keeps the
parameters that it had with it: a favour to these models, which could not predict it otherwise.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.special import logsumexp, ndtr

from warpbrain.arrays import Floats
from warpbrain.atomic import write_csv
from warpbrain.errors import InputError
from warpbrain.gp.coregionalised import JITTER, TASKS, Coregionalised, Likelihood, climb, start, train, training_points
from warpbrain.gp.hierarchy import CENTRE, MEAN_ASYMMETRY, OF_CURVES, OF_SIDES, SAMPLE, Hierarchical
from warpbrain.gp.literature.study import METHODS, OFFSET, Study, invariant, log_secant_modulus

#: Name of the model that ships as the default.
DEFAULT = "hierarchical (the default)"
#: Of each study, for the coregionalised candidates.
POINTS = 20
#: Effects of papers, which a hierarchical candidate can lack.
OF_PAPERS = ("paper", "curve, paper", "asymmetry, paper", "asymmetry at rest, paper")


@dataclass(frozen=True, eq=False)
class Prediction:
    """Of one study that was left out, (n,) each.

    The log density of each of its log energies by itself [nats], their probability integral transforms (how probable it
    was held to be that they are lower), and log energy minus predicted mean.
    """

    log_density: Floats
    pit: Floats
    error: Floats


@dataclass(frozen=True, eq=False)
class CoregionalisedCandidate:
    """The paper's process, or one like it: `separate` groups share nothing but a length scale."""

    name: str
    kernel: str = "matern32"
    mean_modulus: float = 0.0
    separate: bool = False
    #: None before the first fit.
    model: Coregionalised | None = None

    def fitted(self, studies: Sequence[Study]) -> CoregionalisedCandidate:
        """The same kind fitted to studies, from where it stands."""
        data = training_points(studies, self.mean_modulus, POINTS)
        likelihood = Likelihood(data, self.kernel, JITTER)
        if self.model is not None:
            parameters = climb(likelihood, self.model.parameters, 1e-2, 60).parameters
        elif self.separate:
            # no gradient leads away from w = 0
            apart = replace(start(data), w=np.zeros(TASKS), kappa=np.full(TASKS, 1e2))
            parameters = climb(likelihood, apart, 1e-3, 300).parameters
        else:
            parameters = train(data, self.kernel, step=1, gain=1e-3).best.parameters
        model = Coregionalised(tuple(studies), parameters, "", self.kernel, JITTER, self.mean_modulus, POINTS)
        return replace(self, model=model)

    def predict(self, study: Study, stretches: Floats) -> Prediction:
        """What it says of a study that it was not fitted to."""
        assert self.model is not None
        mean, spread = self.model.log_energy(study.group, stretches)
        error = np.log(study.energy(stretches) + OFFSET) - mean
        return _predicted(error[None], spread[None], error)

    def level_pit(self, studies: Sequence[Study], stretches: Sequence[Floats]) -> float:
        """How probable it holds it to be that studies which it was not fitted to are softer in the mean.

        That is of the level: the mean log energy over the stretches of a study, and over studies.
        """
        assert self.model is not None
        mean, spread = self.model.level_of(studies, stretches)
        pairs = zip(studies, stretches, strict=True)
        level = np.mean([np.log(study.energy(l) + OFFSET).mean() for study, l in pairs])
        return float(ndtr((level - mean) / spread))


@dataclass(frozen=True, eq=False)
class HierarchicalCandidate:
    """The hierarchical model, or one that is `without` some of its effects, averaged over a sample of hierarchies.

    A sample of 0 is the best hierarchy alone.
    """

    name: str
    kernel: str = "matern52"
    without: tuple[str, ...] = ()
    mean_asymmetry: tuple[float, float] = MEAN_ASYMMETRY
    sample: int = SAMPLE
    #: None before the first fit.
    model: Hierarchical | None = None

    def fitted(self, studies: Sequence[Study]) -> HierarchicalCandidate:
        """As `CoregionalisedCandidate.fitted`."""
        first = None if self.model is None else self.model.hierarchy
        how = {"first": first, "without": self.without, "mean_asymmetry": self.mean_asymmetry}
        return replace(self, model=Hierarchical.fitted(studies, "", self.kernel, self.sample, **how)[0])

    def predict(self, study: Study, stretches: Floats) -> Prediction:
        """As of `CoregionalisedCandidate`."""
        assert self.model is not None
        moments = self.model.moduli_of([study], [stretches])
        means = np.array([mean for mean, _ in moments])
        spreads = np.sqrt([np.diag(covariance) for _, covariance in moments])
        energy, core = study.energy(stretches), invariant(stretches)
        errors = np.log(energy / core) - means
        # the density of y = ln(Psi + 1e-4) is that of z = ln(Psi / I) times dz/dy
        slope = np.log((energy + OFFSET) / energy)
        away = np.log(energy + OFFSET) - np.log(core * np.exp(means.mean(axis=0)) + OFFSET)
        return _predicted(errors, spreads, away, slope)

    def level_pit(self, studies: Sequence[Study], stretches: Sequence[Floats]) -> float:
        """As of `CoregionalisedCandidate`; of log secant moduli, which differ from log energies by what is known."""
        assert self.model is not None
        moduli = [log_secant_modulus(l, study.energy(l)) for study, l in zip(studies, stretches, strict=True)]
        level = np.mean([of_study.mean() for of_study in moduli])
        weights = np.concatenate([np.full(len(of_study), 1.0 / len(of_study) / len(moduli)) for of_study in moduli])
        each = ((weights @ m, np.sqrt(weights @ c @ weights)) for m, c in self.model.moduli_of(studies, stretches))
        return float(np.mean([ndtr((level - mean) / spread) for mean, spread in each]))


Candidate = CoregionalisedCandidate | HierarchicalCandidate


def candidates() -> tuple[Candidate, ...]:
    """All that are compared, the paper's first."""
    modulus = float(np.exp(CENTRE))
    neo_hookean = "neo-Hookean mean"
    return (
        CoregionalisedCandidate("coregionalised (the paper's)"),
        CoregionalisedCandidate("coregionalised, Matern 1/2", "matern12"),
        CoregionalisedCandidate("coregionalised, Matern 5/2", "matern52"),
        CoregionalisedCandidate("coregionalised, squared exponential", "squared-exponential"),
        CoregionalisedCandidate(f"coregionalised, {neo_hookean}", mean_modulus=modulus),
        CoregionalisedCandidate("one process a group", separate=True),
        CoregionalisedCandidate(f"one process a group, {neo_hookean}", mean_modulus=modulus, separate=True),
        HierarchicalCandidate(DEFAULT),
        HierarchicalCandidate("hierarchical, Matern 3/2", "matern32"),
        HierarchicalCandidate("hierarchical, squared exponential", "squared-exponential"),
        HierarchicalCandidate("hierarchical, papers not told apart", without=OF_PAPERS),
        HierarchicalCandidate("hierarchical, moduli only", without=OF_CURVES + OF_SIDES, mean_asymmetry=(0.0, 0.0)),
        HierarchicalCandidate("hierarchical, no mean asymmetry", mean_asymmetry=(0.0, 0.0)),
        HierarchicalCandidate("hierarchical, best hierarchy alone", sample=0),
    )


def _predicted(errors: Floats, spreads: Floats, away: Floats, slope: Floats | float = 0.0) -> Prediction:
    """By a mixture of normal distributions of equal weight, with errors and spreads (m, n)."""
    densities = -0.5 * (errors / spreads) ** 2 - np.log(spreads) - 0.5 * np.log(2.0 * np.pi)
    density = logsumexp(densities, axis=0) - np.log(len(errors))
    return Prediction(density + slope, ndtr(errors / spreads).mean(axis=0), away)


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
    #: Probability integral transform of the level of each (`level_pit`), evenly spread between 0 and 1 if the model is
    #: calibrated; empty where it was not computed.
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
    candidate: Candidate, studies: Sequence[Study], fold: Fold, progress: Callable[[float], None] = lambda part: None
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
    rows: list[list[str]] = [[*COLUMNS, *held, *_level_columns(held)]]
    for score in scores:
        density = score.log_density, score.log_density_error, score.median
        points = score.rms_error, score.coverage_50, score.coverage_95
        rows.append([score.name, *map(repr, (*density, *points, *score.values, *score.levels))])
    write_csv(path, rows)


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
