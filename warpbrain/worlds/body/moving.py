"""A fitted set with its local mechanisms moved to better places nearby.

Places are chosen in the linear model about the base, in which a mechanism deforms nothing yet. Where it moves a wall by
as much as its own radius, another place and radius may fit better by tens of nats, and what is left at the wrong one
looks like a further cause. A linear model about the fit does not show it either: there the mechanism acts where it is.
So the state with it at another place is computed, all coordinates the same, and is linear about that.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from warpbrain.errors import SolveError
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.causes import scaled
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.fitting import CANNOT_BE_FITTED, Fitter
from warpbrain.worlds.body.placing import places_about
from warpbrain.worlds.body.refit import Refit
from warpbrain.worlds.body.weighted_set import WeightedSet

#: How often places are looked at anew, how far they are apart in spacings of a scan, and by how much [nats] the linear
#: model must say that others are better.
_MOVES, _STEP, _BETTER = 3, 0.25, 1.0


def moved_about_fit(base: Base, fitter: Fitter, fitted: WeightedSet, spacing: float) -> WeightedSet:
    """A fitted set, fitted again where its mechanisms are better placed.

    `spacing`: between the places of a scan [m].
    """
    for _ in range(_MOVES):
        assert fitted.refit is not None
        moved = _moved_once(base, fitter, fitted.refit, _STEP * spacing)
        if moved is None:
            break
        fitted = _with_fit(fitted, moved, moved.log_evidence - fitted.refit.log_evidence)
    return fitted


def _moved_once(base: Base, fitter: Fitter, refit: Refit, step: float) -> Refit | None:
    """The fit with one mechanism a step from where it is; None if none is better."""
    begun = refit
    tried = [
        (*refit.effects[:number], effect, *refit.effects[number + 1 :])
        for number in range(len(refit.effects))
        for effect in _elsewhere(base, refit.effects[number], step)
    ]
    try:
        # all states are near to that of the fit, whose factors lead to each
        about = refit.state.linearised() if tried else None
    except SolveError:
        about = None
    for effects in tried:
        try:
            begun = max(begun, fitter.begin(effects, refit, about), key=lambda fit: fit.log_evidence)
        except CANNOT_BE_FITTED:
            continue
    if begun.log_evidence < refit.log_evidence + _BETTER:
        return None
    try:
        moved = fitter.fit(begun.effects, begun.columns, [], begun.marginal, begun.state, begun)
    except CANNOT_BE_FITTED:
        return None
    return moved if moved.log_evidence > refit.log_evidence else None


def _elsewhere(base: Base, effect: Effect, step: float) -> Iterator[Effect]:
    """An effect at places a step from where it is, in its own columns; none of what is everywhere, or there or not."""
    proposal = effect.proposal
    if proposal is None or proposal.elsewhere is None or proposal.is_there_or_not:
        return
    assert proposal.centre is not None and proposal.radius is not None
    size = float(np.max(proposal.sd / proposal.elsewhere(proposal.centre, proposal.radius).sd))
    for other in places_about(base, proposal, step):
        yield replace(scaled(replace(effect, proposal=other), size), columns=effect.columns)


def _with_fit(fitted: WeightedSet, refit: Refit, better: float) -> WeightedSet:
    """A set at another place that was fitted.

    Both places are as probable as each other before anything is recorded: their evidence is added up.
    """
    return fitted.fitted(refit).with_evidence(fitted.hypothesis.log_evidence + float(np.logaddexp(0.0, better)))
