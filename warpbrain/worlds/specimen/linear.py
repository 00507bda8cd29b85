"""Causes to first order about a fit: what each would change of the fitted rows, for the posterior over sets of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference.beliefs import belief, beliefs
from warpbrain.inference.calibration import calibration
from warpbrain.inference.causes import Cause, Kind, Place
from warpbrain.inference.decide import UNKNOWN
from warpbrain.inference.hypothesis import Configuration, Posterior
from warpbrain.inference.noise import scales
from warpbrain.inference.subsets import Search, posterior
from warpbrain.worlds.specimen.actions import Effect, Variant
from warpbrain.worlds.specimen.fit import CANNOT_BE, Fit
from warpbrain.worlds.specimen.forward import Component
from warpbrain.worlds.specimen.noise import smooth_patterns

_PRIORS = {Kind.PHYSICS: "causes.mechanism", Kind.NOT_PHYSICS: "causes.not_physics", Kind.UNKNOWN: "causes.unknown"}


def log_odds(kind: Kind) -> float:
    """That a cause of a kind acts, before anything was recorded."""
    # probabilities divide all logarithms by the temperature, but it is evidence alone that is too sharp
    return calibration().temperature * float(np.log(belief(_PRIORS[kind])))


@dataclass(frozen=True, eq=False)
class Linear:
    """Causes about a fit.

    Attributes
    ----------
    fit : Fit
    causes : tuple of Cause
        With columns at the fitted rows.
    effects : tuple of Effect or None
        Of each cause; None of the unknown.
    trials : tuple of tuples of (Variant, (m, k) array)
        Of each cause, of each of its places.
    smooth : tuple of (n, q) arrays
        The places of the unknown, at all rows.
    """

    fit: Fit
    causes: tuple[Cause, ...]
    effects: tuple[Effect | None, ...]
    trials: tuple[tuple[tuple[Variant, Floats], ...], ...]
    smooth: tuple[Floats, ...]

    def posterior(self, beam: int) -> Posterior:
        """Over sets of these causes beside those of the fit."""
        values, logs = scales()
        residual = self.fit.residual[self.fit.rows]
        return posterior(self.fit.model.with_scale(1.0), residual, self.causes, Search(values, logs, beam=beam))

    def start(self, best: Configuration) -> tuple[tuple[Component, ...], Floats, Floats]:
        """Causes of the fit and of a configuration, smooth changes, and coefficients to begin at."""
        fit, sizes = self.fit, beliefs("specimen.sizes")
        assumed, unknown, widths = list(fit.assumed), fit.unknown, []
        columns = []
        for member in best.members:
            size = float(sizes[member.size])
            columns.append(size * self.causes[member.cause].places[member.place].columns)
            widths.append(columns[-1].shape[1])
            effect = self.effects[member.cause]
            if effect is None:
                unknown = size * self.smooth[member.place]
            else:
                assumed.append(Component(effect, *self.trials[member.cause][member.place], size))
        model = fit.model.with_scale(best.scale)
        known = model.columns.shape[1]
        if columns:
            model = model.with_columns(np.concatenate(columns, axis=1))
        mean = model.coefficients(fit.residual[fit.rows])[0]
        parts = [mean[fit.unknown.shape[1] : known]]
        moves = iter(np.split(mean[known:], np.cumsum(widths)[:-1]) if widths else [])
        new = iter(assumed[len(fit.assumed) :])
        for member, move in zip(best.members, moves, strict=True):
            if self.effects[member.cause] is not None:
                one = next(new)
                c = one.variant.nothing + one.size * move @ (one.trial - one.variant.nothing)
                parts.append((c - one.variant.mean) / one.sd)
        return tuple(assumed), unknown, np.concatenate(parts)


def linearise(fit: Fit, effects: Sequence[Effect]) -> Linear:
    """Of all causes that the fit does not have; places where there is no state are left out."""
    causes: list[Cause] = []
    kept: list[Effect | None] = []
    trials: list[tuple[tuple[Variant, Floats], ...]] = []
    rows, sizes = fit.rows, beliefs("specimen.sizes")
    for effect in effects:
        if effect.name in fit.names:
            continue
        places = [(place, found) for place in effect.places if (found := _columns(fit, *place)) is not None]
        if places:
            columns = tuple(Place(found[rows]) for _, found in places)
            causes.append(Cause(effect.name, columns, log_odds(effect.kind), sizes, effect.kind))
            kept.append(effect)
            trials.append(tuple(place for place, _ in places))
    thinned = fit.forward.protocol
    smooth = tuple(
        belief("specimen.largest_unknown") * smooth_patterns(thinned, reach)
        for reach in beliefs("specimen.unknown_reaches")
    )
    # what acts in tests that were not fitted shows in no row
    smooth = tuple(own[:, np.any(own[rows] != 0.0, axis=0)] for own in smooth)
    if UNKNOWN not in fit.names:
        anywhere = tuple(Place(own[rows]) for own in smooth)
        causes.append(Cause(UNKNOWN, anywhere, log_odds(Kind.UNKNOWN), sizes, Kind.UNKNOWN))
        kept.append(None)
        trials.append(())
    return Linear(fit, tuple(causes), tuple(kept), tuple(trials), smooth)


def _columns(fit: Fit, variant: Variant, trial: Floats) -> Floats | None:
    """What trials change (n, m) beside all that the fit has; None where there is no state."""
    forward = fit.forward
    try:
        with np.errstate(all="ignore"):
            actions = forward.actions(fit.assumed, fit.z)
            each = [forward.stress_of([*actions, variant.act(c, forward.declared)], fit.z) for c in trial]
    except CANNOT_BE:
        return None
    found = np.column_stack(each) - fit.stress[:, None]
    return found if np.isfinite(found).all() else None
