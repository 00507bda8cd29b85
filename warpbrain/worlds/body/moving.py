"""A fitted set with its local mechanisms moved to better places nearby, as its fit shows them.

Places are chosen in the linear model about the base, in which a mechanism deforms nothing yet. Where it moves a wall by
as much as its own radius, another place and radius may fit better by tens of nats, and what is left at the wrong one
looks like a further cause.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpbrain.errors import InputError, SolveError
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.causes import scaled
from warpbrain.worlds.body.effects import Effect, Effects
from warpbrain.worlds.body.evidence import evidence_of
from warpbrain.worlds.body.fitting import Fitter
from warpbrain.worlds.body.refit import Refit
from warpbrain.worlds.body.weighing import with_refined_places
from warpbrain.worlds.body.weighted_set import WeightedSet

#: How often places are looked at anew, and by how much [nats] the linear model must say that others are better.
_MOVES, _BETTER = 3, 1.0


def moved_about_fit(
    base: Base, fitter: Fitter, fitted: WeightedSet, spacing: float, least: float = _BETTER
) -> WeightedSet:
    """A fitted set, fitted again where its mechanisms are better placed.

    Parameters
    ----------
    base : Base
    fitter : Fitter
    fitted : WeightedSet
    spacing : float
        Between the places of a scan [m].
    least : float
        Log evidence [nats] that it has to gain to matter.
    """
    start = fitted.hypothesis.log_evidence
    for _ in range(_MOVES):
        gained = fitted.hypothesis.log_evidence - start
        moved = _moved_once(base, fitter, fitted, spacing, max(least - gained, _BETTER))
        if moved is None:
            break
        fitted = moved
    return fitted


def _moved_once(base: Base, fitter: Fitter, fitted: WeightedSet, spacing: float, least: float) -> WeightedSet | None:
    """The same at the best places in the cells about those of the fit; None if no others are better."""
    refit = fitted.refit
    assert refit is not None
    if not any(_can_be_elsewhere(effect) for effect in fitted.effects):
        return None
    try:
        source = Effects(refit.state.linearised(), mesh_errors=base.mesh_errors)
        begun = _about_fit(base, fitted, source)
        moved = with_refined_places(base, begun, spacing, source)
        if moved.effects == begun.effects or moved.marginal.log_evidence < begun.marginal.log_evidence + least:
            return None
        again = fitter.fit(moved.effects, moved.columns, [moved.coordinates], moved.marginal, refit.state, refit)
    except (SolveError, InputError, np.linalg.LinAlgError, FloatingPointError):
        return None
    return _with_fit(fitted, again, again.log_evidence - refit.log_evidence)


def _can_be_elsewhere(effect: Effect) -> bool:
    proposal = effect.proposal
    return proposal is not None and proposal.elsewhere is not None and not proposal.is_there_or_not


def _about_fit(base: Base, fitted: WeightedSet, source: Effects) -> WeightedSet:
    """The linear model about a fit, with its local effects as those of other places are made: no mesh's share."""
    effects, columns = list(fitted.effects), fitted.columns.copy()
    for number, (effect, part) in enumerate(zip(fitted.effects, fitted.slices, strict=True)):
        if not _can_be_elsewhere(effect):
            continue
        here = effect.proposed
        assert here.elsewhere is not None and here.centre is not None and here.radius is not None
        usual = here.elsewhere(here.centre, here.radius)
        effects[number] = scaled(source.of([usual])[0], float(np.max(here.sd / usual.sd)))
        columns[:, part] = effects[number].columns
    columns, marginal = evidence_of(base, columns, fitted.residual, fitted.marginal.scale)
    return replace(fitted, effects=tuple(effects), columns=columns, marginal=marginal, refined=False)


def _with_fit(fitted: WeightedSet, refit: Refit, better: float) -> WeightedSet | None:
    """A set at another place that was fitted; None if that is no better.

    Both places are as probable as each other before anything is recorded: their evidence is added up.
    """
    if better <= 0.0:
        return None
    moved = replace(
        fitted,
        effects=refit.effects,
        residual=refit.linear,
        columns=refit.columns,
        marginal=refit.marginal,
        refit=refit,
    )
    return moved.with_evidence(fitted.hypothesis.log_evidence + float(np.logaddexp(0.0, better)))
