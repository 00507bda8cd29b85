"""Checks of sets of causes by the model that they were weighed with; see `warpbrain.inference.confirm`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.held_out import HeldOut, share_of_patterns, tries_of
from warpbrain.inference import GaussianModel, Kind
from warpbrain.inference.beliefs import beliefs
from warpbrain.inference.calibration import calibration
from warpbrain.inference.confirm import Confirmation
from warpbrain.inference.predict import Prediction, predictive_p
from warpbrain.worlds.body.hypotheses import HypothesisSearch
from warpbrain.worlds.body.weighted_set import WeightedSet

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class HeldOutErrors:
    """Held-out rows with a set of causes and with none.

    Attributes
    ----------
    without, explained : Prediction
    improvement : (part, low, high)
        Of the error that is gone.
    patterns : (low, high)
        Errors [m] between which nine of ten patterns that mean nothing are.
    """

    without: Prediction
    explained: Prediction
    improvement: tuple[float, float, float]
    patterns: tuple[float, float]


class Confirming:
    """Checks the sets of one search.

    Parameters
    ----------
    search : HypothesisSearch
    draws : int
        Of rows in which nothing is missing.
    random : Generator
    """

    def __init__(self, search: HypothesisSearch, draws: int, random: np.random.Generator) -> None:
        self.search, self._draws, self._random = search, draws, random
        sensors = search.base.at.sensors
        self._ways = {local: HeldOut(sensors, local) for local in (False, True)}
        #: Columns (n, m) of a smooth force as large as the noise, of which patterns that mean nothing are made.
        self.modes = search.base.typical_noise * next(iter(search.base.unknown.values()))

    def p_of_nothing(self, nothing: WeightedSet) -> float:
        """Probability of rows of which any cause explains as much, if none acts.

        It is asked of draws of nothing, with the gross errors that it has; what a local cause moves may be among these,
        and then the Bayes factor of all that may act, each with gross errors of its own, tells. Of data without any the
        chance that it is `b` or more is `1 / b` at most (Markov's inequality). Twice asked, it is twice as easily said.
        """
        drawn = self._p(nothing.marginal.model, nothing.residual, physics=True)
        bound = float(np.exp(-max(self.search.log_bayes_factor, 0.0) / calibration().temperature))
        return min(1.0, 2.0 * min(drawn, bound))

    def p_left(self, one: WeightedSet) -> float:
        """Probability of rows of which a field without a name explains as much, if a set is all that acts."""
        return self._p(one.marginal.model, one.residual, physics=False)

    def _p(self, model: GaussianModel, residual: Floats, physics: bool) -> float:
        fields, weights = [], []
        for cause in self.search.causes.causes:
            if cause.kind is Kind.UNKNOWN or (physics and cause.kind is Kind.PHYSICS):
                each = [_with_mean(place.columns, place.mean) for place in cause.places]
                fields += each
                weights += [-np.log(len(each))] * len(each)
        logs = np.array(weights) - np.logaddexp.reduce(weights)
        return predictive_p(model, fields, beliefs("unknown.sizes"), residual, self._draws, self._random, logs)

    def way(self, one: WeightedSet) -> HeldOut:
        """Blocks that suit what acts: here and there where all of it is local."""
        local = bool(one.effects) and all(effect.proposed.centre is not None for effect in one.effects)
        return self._ways[local]

    def predict(self, one: WeightedSet, way: HeldOut) -> Prediction:
        """Held-out rows with a set."""
        return way.predict(one.marginal.model, one.residual)

    def confirmations(self, one: WeightedSet) -> tuple[Confirmation, ...]:
        """Of each mechanism of a set, where all others of it act."""
        return tuple(self._confirm(one, name) for name in one.mechanisms)

    def _confirm(self, one: WeightedSet, name: str) -> Confirmation:
        others = self.search.get(one.names - {name})
        effect = one.effects[one.mechanisms.index(name)]
        way = self._ways[effect.proposed.centre is not None]
        if others is None:
            others = one.without(name, self.search.base)
        own, before = self.predict(one, way), self.predict(others, way)
        patterns = self._patterns(others, way, effect.columns.shape[1], len(self.search.causes.named(name).places))
        return Confirmation(
            name,
            one.hypothesis.log_evidence - others.hypothesis.log_evidence,
            own.gain(before),
            way.improvement(own, before, self._random),
            share_of_patterns(own, patterns),
        )

    def _patterns(self, others: WeightedSet, way: HeldOut, freedom: int, places: int) -> tuple[Prediction, ...]:
        model = others.marginal.model
        return way.with_patterns(model, others.residual, self.modes, freedom, tries_of(places), self._random)

    def held_out(self, nothing: WeightedSet, one: WeightedSet) -> HeldOutErrors:
        """A set beside none."""
        way = self.way(one)
        without, explained = self.predict(nothing, way), self.predict(one, way)
        freedom = sum(effect.columns.shape[1] for effect in one.effects)
        places = max((len(self.search.causes.named(name).places) for name in one.mechanisms), default=1)
        patterns = self._patterns(nothing, way, max(freedom, 1), places)
        errors = [way.error(pattern) for pattern in patterns]
        low, high = np.quantile(errors, [0.05, 0.95]).tolist()
        return HeldOutErrors(
            without,
            explained,
            way.improvement(explained, without, self._random),
            (low, high),
        )

    def ceiling(self, nothing: WeightedSet, way: HeldOut) -> float:
        """Held-out error [m] with any field without a name."""
        fields = [self.search.base.typical_noise * columns for columns in self.search.base.unknown.values()]
        return way.ceiling(nothing.marginal.model, nothing.residual, fields)


def _with_mean(columns: Floats, mean: Floats | None) -> Floats:
    return columns if mean is None else np.column_stack([mean, columns])
