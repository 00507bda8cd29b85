"""Checks of a fit by the model it was made with: held-out tests, patterns that mean nothing, and what is left.

They never choose between causes. One that fails takes a name back, or says that something is left.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.inference.beliefs import beliefs
from warpbrain.inference.causes import Cause, Kind, Place
from warpbrain.inference.decide import Confirmation
from warpbrain.inference.gaussian import GaussianModel
from warpbrain.inference.predict import Prediction, p_value, predict, predictive_p
from warpbrain.inference.subsets import Blocks
from warpbrain.physics.words import pascals
from warpbrain.recordings.comparison import root_mean_square
from warpbrain.worlds.specimen.fit import Fit
from warpbrain.worlds.specimen.protocol import Protocol
from warpbrain.worlds.specimen.result import Score
from warpbrain.worlds.specimen.search import Linear, Sets

#: Parts of a test that are held out where it is the only one, and blocks of its rows for intervals.
_BLOCKS = 4
#: Patterns that mean nothing, waves of each, and their length in widths of what they are functions of.
_PLACEBOS, _WAVES, _LENGTH = 100, 40, 0.6


@dataclass(frozen=True, eq=False)
class CheckResults:
    """A fit beside the base; see `SpecimenDiagnosis` for what these are."""

    p_left: float | None
    scores: dict[str, Score]
    stresses: dict[str, Floats]
    improvement: tuple[float, float, float] | None = None
    confirmations: tuple[Confirmation, ...] = ()


@dataclass(frozen=True, eq=False)
class _Predicted:
    """Stress and held-out stress of a fit at all recorded rows (n,) [Pa], and its held-out log density."""

    stress: Floats
    held: Floats
    log_density: float


class Checker:
    """Checks fits of one diagnosis by all recorded rows.

    `draws`: of rows in which nothing is left, at first. `alpha`: with which p-values are compared.
    """

    def __init__(self, sets: Sets, protocol: Protocol, draws: int, random: np.random.Generator, alpha: float) -> None:
        self.sets, self.protocol, self._draws, self._random, self._alpha = sets, protocol, draws, random, alpha
        self.folds = folds_of(protocol.thinned)
        self._predictions: dict[Fit, _Predicted] = {}

    def p_left(self, fit: Fit) -> float:
        """Posterior predictive probability of rows that other causes explain as well, if a fit has all that acts.

        Rows are drawn from the fit's own model, so that having looked for many things in many ways is paid for.
        """
        fields = [place.columns for cause in self.sets.about(fit).causes for place in cause.places]
        sizes, residual = beliefs("specimen.sizes"), fit.residual[fit.rows]
        return predictive_p(fit.model, fields, sizes, residual, self._draws, self._random, levels=[self._alpha])

    def of(self, fit: Fit) -> CheckResults:
        """Everything about a fit; of the base only its errors."""
        base = self.sets.base
        scores: dict[str, Score] = {}
        stresses: dict[str, Floats] = {}
        for name, compared in ({"refitted": base} if fit is base else {"refitted": base, "explained": fit}).items():
            predicted = self._predicted(compared)
            stresses |= {name: predicted.stress, f"heldout {name}": predicted.held}
            scores[name] = score(self.protocol, predicted.stress, predicted.held)
        if fit is base:
            return CheckResults(None, scores, stresses)
        names = [component.effect.name for component in fit.assumed if component.effect.kind is Kind.PHYSICS]
        confirmations = [confirmation for name in names if (confirmation := self._confirm(fit, name)) is not None]
        return CheckResults(self.p_left(fit), scores, stresses, self._improvement(base, fit), tuple(confirmations))

    def heldout_rms(self, fit: Fit) -> float:
        """Of all recorded rows of tests that were held out in turn [Pa]."""
        return root_mean_square((self.protocol.observed - self._predicted(fit).held)[self.protocol.fitted])

    def _predicted(self, fit: Fit) -> _Predicted:
        if fit not in self._predictions:
            # what has no name is known at thinned rows alone, and explains nothing of others
            assumed, z = fit.only(lambda effect: effect.kind is not Kind.UNKNOWN)
            everywhere, z = replace(fit.forward, protocol=self.protocol), np.concatenate([fit.z[: len(fit.forward)], z])
            stress = everywhere.stress(assumed, z)
            predicted, log_density = held_out(fit, self.folds)
            # of thinned rows it is known by how much it differs from the fit: smoothly
            held = stress + self.protocol.spread(predicted - fit.forward.stress(assumed, z))
            self._predictions[fit] = _Predicted(stress, held, log_density)
        return self._predictions[fit]

    def _improvement(self, before: Fit, after: Fit) -> tuple[float, float, float]:
        """Of held-out errors relative to the largest stress of each test."""
        observed, peaks, blocks = self.protocol.observed, self.protocol.peaks, _blocks(self.protocol)
        first, second = (
            Prediction((observed - self._predicted(fit).held) / peaks, blocks, np.zeros(0)) for fit in (before, after)
        )
        return second.improvement(first, self.protocol.fitted, self._random)

    def _confirm(self, fit: Fit, name: str) -> Confirmation | None:
        """Of one cause where all others of the fit act; None if no fit stands without it."""
        others = self.sets.fitted(fit.names - {name})
        if others is None:
            return None
        evidence = [self.sets.by_names[names].hypothesis.log_evidence for names in (fit.names, others.names)]
        gained = self._predicted(fit).log_density - self._predicted(others).log_density
        p = _placebo_p(self.sets.about(others), name, self.folds, self._random)
        return Confirmation(name, evidence[0] - evidence[1], gained, self._improvement(others, fit), p)


def score(protocol: Protocol, stress: Floats, held: Floats | None = None) -> Score:
    """Errors of stresses (n,) at all recorded rows [Pa]."""
    errors = protocol.observed - stress
    tests = zip(protocol.tests, protocol.rows, strict=True)
    check = {test.name: root_mean_square(errors[rows]) for test, rows in tests if not test.fitted}
    outside = None if held is None else root_mean_square((protocol.observed - held)[protocol.fitted])
    return Score(root_mean_square(errors[protocol.fitted]), outside, check)


def grown_errors(checked: CheckResults) -> tuple[list[str], list[str]]:
    """Errors that are larger with what was added than without, in words: of held-out tests, of tests never fitted."""
    if "explained" not in checked.scores:
        return [], []
    before, after = (checked.scores[name] for name in ("refitted", "explained"))
    first, second = before.heldout or 0.0, after.heldout or 0.0
    grown = [f"The error of held-out tests grows with it: from {pascals(first)} to {pascals(second)}."]
    checks = [
        f"'{name}', which was not fitted, is predicted worse with it: {pascals(before.check[name])} without, "
        f"{pascals(after.check[name])} with it."
        for name in before.check
        if after.check[name] > before.check[name]
    ]
    return grown if second > first else [], checks


def folds_of(protocol: Protocol) -> list[Bools]:
    """Rows (n,) that are held out in turn: each test that may be fitted, or each quarter of the only one."""
    if protocol.by_test:
        return [protocol.mask([number]) for number in protocol.to_fit]
    blocks = _blocks(protocol)
    return [protocol.fitted & (blocks == k) for k in np.unique(blocks[protocol.fitted])]


def _blocks(protocol: Protocol) -> Ints:
    """Parts of tests by number (n,)."""
    each = [
        _BLOCKS * k + np.minimum((_BLOCKS * test.path / max(float(test.path[-1]), 1e-12)).astype(np.int64), _BLOCKS - 1)
        for k, test in enumerate(protocol.tests)
    ]
    return np.concatenate(each)


def held_out(fit: Fit, folds: Sequence[Bools]) -> tuple[Floats, float]:
    """What a fit says of each fold's rows given the others: its causes fitted to these, and linear about that.

    `folds` (n,): rows that are held out in turn.

    Returns the predicted stress (n,) [Pa], NaN where nothing was held out, and the log density of all folds.
    """
    rows = fit.rows
    predicted, total = np.full(len(rows), np.nan), 0.0
    for held in folds:
        again = fit.refitted_to(rows & ~held)
        model = GaussianModel(fit.model.noise_factor, again.columns[rows], fit.scale)
        given = predict(model, again.residual[rows], held[rows].astype(np.int64))
        # the observed rows are the first block, the held ones the last
        predicted[held] = fit.forward.protocol.observed[held] - given.errors[held[rows]]
        total += float(given.log_densities[-1])
    return predicted, total


def _placebo_p(about: Linear, name: str, folds: Sequence[Bools], random: np.random.Generator) -> float:
    """Probability that a pattern that means nothing predicts held-out rows as well as a cause does.

    A pattern is a random smooth function of stretch, shear, the path of a test and the logarithm of its time, the
    same in all tests, so that it can carry over to those that are held out as a cause does. It has as many places and
    columns as the cause, of the same sizes, and both are in the same model: about the fit without the cause.
    """
    fit = about.fit
    cause = next(candidate for candidate in about.causes if candidate.name == name)
    length = np.sqrt(np.mean([np.mean(place.columns**2) for place in cause.places]))
    peaks = fit.forward.protocol.peaks[fit.rows]
    where, causes = _coordinates(fit.forward.protocol)[fit.rows], [cause]
    for number in range(_PLACEBOS):
        places = []
        for place in cause.places:
            pattern = peaks[:, None] * _pattern(where, place.columns.shape[1], random)
            places.append(Place(pattern * length / np.sqrt(np.mean(pattern**2))))
        causes.append(Cause(str(number), tuple(places), 0.0, cause.sizes))
    residual = fit.residual[fit.rows]
    total, of_all_rows = np.zeros(len(causes)), _log_densities(fit.model, residual, causes)
    for held in folds:
        observed = ~held[fit.rows]
        kept = [replace(each, places=tuple(Place(place.columns[observed]) for place in each.places)) for each in causes]
        total += of_all_rows - _log_densities(fit.model.rows(observed), residual[observed], kept)
    return p_value(total[0], total[1:])


def _log_densities(model: GaussianModel, residual: Floats, causes: Sequence[Cause]) -> Floats:
    """Of rows under each cause, summed over its places and sizes."""
    blocks = Blocks(model, residual, causes)
    logs = np.logaddexp.reduce(blocks.log_factors() + blocks.log_weights, axis=1)
    log_densities = np.full(len(causes), -np.inf)
    np.logaddexp.at(log_densities, blocks.cause, logs)
    return np.asarray(log_densities + float(model.log_density(residual)))


def _pattern(where: Floats, count: int, random: np.random.Generator) -> Floats:
    """Random smooth functions (n, count) of coordinates (n, d): sums of waves."""
    waves = random.normal(size=(where.shape[1], _WAVES * count)) / _LENGTH
    phases = random.uniform(0.0, 2.0 * np.pi, size=_WAVES * count)
    weights = random.normal(size=_WAVES * count)
    return (weights * np.cos(where @ waves + phases)).reshape(len(where), _WAVES, count).sum(axis=1)


def _coordinates(protocol: Protocol) -> Floats:
    """Stretch and shear over their largest, path of the test and logarithm of its time (n, 4)."""
    rows = []
    for test in protocol.tests:
        strain, zero = (test.strain - test.rest) / test.reach, np.zeros(len(test.strain))
        stretch, shear = (strain, zero) if test.rest == 1.0 else (zero, strain)
        since = zero if test.time is None else np.log1p(test.time - test.time[0]) / 5.0
        rows.append(np.column_stack([stretch, shear, test.path / max(float(test.path[-1]), 1e-12), since]))
    return np.concatenate(rows)
