"""Fitted sets whose mechanisms are moved to where they are the most probable.

Where a mechanism moves a wall by as much as its own radius, another place and radius may fit better by tens of nats
than that chosen about the base, in which it deforms nothing yet, and what is left at the wrong one looks like a further
cause. So the model that is linear about a fit is linear in the places of its mechanisms, too, and a set is fitted again
where these are the most probable.
"""

from dataclasses import replace

import numpy as np

from warpbrain.errors import SolveError
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.effects import column_slices
from warpbrain.worlds.body.fitting import CANNOT_BE_FITTED, Fitter
from warpbrain.worlds.body.places import LikelyPlaces, PlaceCoordinates
from warpbrain.worlds.body.weighted_set import Refit, WeightedSet

#: How often mechanisms are moved, by how much [nats] the linear model must say that another place is better, and parts
#: of the way to it that are tried.
_MOVES, _BETTER, _LENGTHS = 4, 1.0, (1.0, 0.5, 0.25)


def moved_about_fit(base: Base, fitter: Fitter, fitted: WeightedSet, spacing: float) -> WeightedSet:
    """A fitted set, fitted again where its mechanisms are better placed; and how well their places are known there.

    `spacing`: between the places of a scan [m].
    """
    fitted, refit = replace(fitted, moved=True), fitted.refit
    assert refit is not None
    if not fitted.is_placed:
        return fitted
    try:
        about = LinearInPlaces(base, fitter, refit, spacing)
    except SolveError:
        return fitted
    for _ in range(_MOVES):
        moved = about.moved()
        if moved is None:
            break
        try:
            about = LinearInPlaces(base, fitter, moved, spacing)
        except SolveError:
            break
    gain = about.refit.log_evidence - refit.log_evidence
    moved_set = fitted if about.refit is refit else fitted.fitted(about.refit).with_gain(gain)
    return replace(moved_set, places=about.likely)


class LinearInPlaces:
    """The model that is linear about a fit, in the places of its mechanisms, too.

    `spacing`: between the places of a scan [m]; half of it is the standard deviation of a place beforehand.
    `SolveError` if nothing is linear about the fit.
    """

    def __init__(self, base: Base, fitter: Fitter, refit: Refit, spacing: float) -> None:
        self.refit, self._fitter, self._about = refit, fitter, refit.state.linearised()
        self._placed = {
            number: PlaceCoordinates(base.at.system.model, effect.proposed, 0.5 * spacing)
            for number, effect in enumerate(refit.effects)
            if effect.is_placed
        }
        each = [
            place.columns(self._about, refit.effects[number], refit.coefficients[number])
            for number, place in self._placed.items()
        ]
        self._first = refit.marginal.model.columns.shape[1]
        self._model = refit.marginal.model.with_columns(np.column_stack(each))
        self._best, self._covariance = self._model.coefficients(refit.linear)

    @property
    def likely(self) -> dict[int, LikelyPlaces]:
        """Places of effects by their numbers."""
        likely = {}
        for k, (number, place) in enumerate(self._placed.items()):
            part = slice(self._first + 4 * k, self._first + 4 * (k + 1))
            likely[number] = LikelyPlaces(place, self._best[part], self._covariance[part, part])
        return likely

    @property
    def gain(self) -> float:
        """Increase [nats] of the log posterior density from the places of the fit to the most probable ones.

        Without the volume of places about either: fits are compared at one place each.
        """
        rows = self.refit.linear
        before, after = (np.sum(m.standardised(rows) ** 2) for m in (self.refit.marginal.model, self._model))
        return 0.5 * float(before - after)

    def moved(self) -> Refit | None:
        """The fit with the mechanisms at the best places, or on the way to them; None if that is no better."""
        if self.gain < _BETTER:
            return None
        refit, likely = self.refit, self.likely
        here = np.concatenate([refit.nuisances, *refit.coefficients])
        starts = [part.start for part in column_slices(refit.effects, len(refit.nuisances))]
        for length in _LENGTHS:
            effects = list(refit.effects)
            for number, places in likely.items():
                effects[number] = places.coordinates.effect_at(length * places.mean, effects[number])
            nuisances, *coefficients = np.split(here + length * (self._best[: len(here)] - here), starts)
            there = replace(refit, nuisances=nuisances, coefficients=tuple(coefficients))
            try:
                begun = self._fitter.begin(tuple(effects), there, self._about)
                if begun.marginal.log_evidence < refit.marginal.log_evidence + _BETTER:
                    continue
                moved = self._fitter.fit(begun.effects, begun.columns, [], begun.marginal, begun.state, begun)
            except CANNOT_BE_FITTED:
                continue
            if moved.log_evidence > refit.log_evidence:
                return moved
        return None
