"""Which set of causes is worth fitting next: the value of information of a fit for the verdict.

A fit costs many equilibria, and tells by how much the evidence of a set differs from that in the linear model; fits at
other places tell how much better a mechanism would be there. Either is worth its cost where the verdict of least
expected loss could be regretted once this is known. Of the set that a name or an unknown rests on both are always done.
Where a body moves far the linear model says little of any cause: `bend_of`.
"""

from collections.abc import Collection, Iterable, Sequence

import numpy as np

from warpbrain.inference.beliefs import belief
from warpbrain.inference.calibration import calibration
from warpbrain.inference.causes import Hypothesis
from warpbrain.inference.decide import GROUP, NAMED, NAMED_AND_REST, UNKNOWN, Decision, decide
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.weighted_set import WeightedSet


def next_to_fit(
    sets: Sequence[WeightedSet],
    expanded: Collection[frozenset[str]],
    rivals: bool = True,
) -> WeightedSet | None:
    """The set that is fitted next, or at neighbouring places, or whose supersets are weighed; None to stop.

    `sets`: the most probable first.
    `expanded`: fitted sets whose supersets were weighed about their fit.
    `rivals`: whether sets that the verdict does not rest on may be chosen, too.
    """
    decision, _ = _decide(sets)
    named = [candidate for candidate in sets if frozenset(candidate.mechanisms) == frozenset(decision.causes)]
    if named and named[0].mechanisms and not _is_settled(named, expanded):
        chosen = named[0]
    elif part := (
        _part_not_fitted(decision, sets)
        or _unknown_not_fitted(decision, sets, expanded)
        or _rival_without_a_name(decision, sets)
    ):
        chosen = part
    elif not rivals:
        return None
    else:
        open_sets = (candidate for candidate in sets if candidate.is_open)
        matters = (candidate for candidate in open_sets if _may_be_regretted(candidate, sets, decision))
        first = next(matters, None)
        if first is None:
            return None
        chosen = first
    return _subset_first(chosen, sets, expanded)


def bend_of(base: Base) -> float:
    """Part of log evidence that the linear model may be wrong by: how far recorded points went, squared.

    Relative to the body's size. What is linear in loads misses turns of the body to second order: a cantilever that
    sags by half its length is drawn out by as much, and no linear column is of it. In a brain this is less than a
    hundredth.
    """
    sensors, size = base.declared.sensors, base.at.system.model.mesh.volume ** (1.0 / 3.0)
    rows = sensors.is_displacement & ~sensors.of_surfaces
    # squared lengths of displacements, which are the same in all axes
    squares = np.bincount(sensors.groups[rows], (sensors.residual + sensors.computed)[rows] ** 2)
    return float(squares.max(initial=0.0)) / size**2


def far_from_linear(sets: Sequence[WeightedSet], bend: float) -> WeightedSet | None:
    """A mechanism that was not fitted and may be the best for all that the linear model knows; None if there is none.

    `sets`: with that of no cause. `bend`: see `bend_of`: of what is at stake, the evidence of the best set over that of
    nothing.
    """
    single = [s for s in sets if len(s.names) == 1 and s.acting and s.refit is None and not s.failure]
    return _first_that_may_be_best(sorted(single, key=lambda s: -s.hypothesis.log_evidence), sets, bend)


def _first_that_may_be_best(
    candidates: Iterable[WeightedSet], sets: Sequence[WeightedSet], part: float
) -> WeightedSet | None:
    """The first candidate that is as probable as the best of all sets if its log evidence is wrong; None if none is.

    The error of a linear model is in proportion to what it explains: it is taken to be the `part` of the difference
    between the log evidence of the best set and that of no cause.
    """
    nothing = next(candidate.hypothesis.log_evidence for candidate in sets if not candidate.names)
    best = max(candidate.hypothesis.log_evidence for candidate in sets)
    least = best - part * (best - nothing)
    return next((candidate for candidate in candidates if candidate.hypothesis.log_evidence >= least), None)


def _decide(
    sets: Sequence[WeightedSet], changed: WeightedSet | None = None, change: float = 0.0
) -> tuple[Decision, dict[Decision, float]]:
    """The best verdict and the expected losses, were the log evidence of a set another by some change."""
    hypotheses: list[Hypothesis] = [candidate.hypothesis for candidate in sets if candidate is not changed]
    if changed is not None:
        hypotheses.append(changed.with_evidence(changed.hypothesis.log_evidence + change).hypothesis)
    return decide(hypotheses, calibration().probabilities(hypotheses), calibration().losses)


def _is_settled(named: Sequence[WeightedSet], expanded: Collection[frozenset[str]]) -> bool:
    """Whether nothing is left to do about sets of the mechanisms that are named, the most probable first.

    That one is fitted, since it is what the verdict rests on, and one that is fitted is expanded.
    """
    if named[0].is_open:
        return False
    if named[0].refit is None:
        return True
    fitted = (candidate for candidate in named if candidate.refit is not None)
    return any(candidate.names in expanded or len(candidate.names) > 2 for candidate in fitted)


def _part_not_fitted(decision: Decision, sets: Sequence[WeightedSet]) -> WeightedSet | None:
    """A set of all but one of several mechanisms that are named, which was not fitted; None if there is none.

    What two explain in the linear model one may explain as well that is far from linear, such as a course in time.
    """
    named = frozenset(decision.causes)
    parts = (candidate for candidate in sets if candidate.names < named and len(candidate.names) == len(named) - 1)
    return next((part for part in parts if part.names and part.is_open), None)


def _unknown_not_fitted(
    decision: Decision, sets: Sequence[WeightedSet], expanded: Collection[frozenset[str]]
) -> WeightedSet | None:
    """What is to be fitted, or expanded, before something without a name is a part of the verdict; None if all was.

    Of a verdict of the unknown alone the likeliest set with that alone, and that without it: in the linear model, what
    a finite rigid rotation does to second order looks like an unknown force. Of any the likeliest set of mechanisms
    alone, and the likeliest single one with what may act beside it: sets with the unknown are many, and what a
    mechanism does that is far from linear, such as tissue that relaxes under another one's load, looks like one.
    Of the unknown alone, or of a group that it is in, every single mechanism, too, that may be as probable once it is
    fitted.
    """
    nameless = decision.verdict == UNKNOWN or (decision.verdict == GROUP and UNKNOWN in decision.causes)
    if not nameless and not (decision.verdict == NAMED_AND_REST and UNKNOWN in sets[0].names):
        return None
    without_names = (candidate for candidate in sets if UNKNOWN in candidate.names and not candidate.mechanisms)
    likely = next((candidate.names for candidate in without_names), frozenset())
    alone = (likely, likely - {UNKNOWN}) if nameless else ()
    of_mechanisms = [s for s in sets if 0 < len(s.names) == len(s.mechanisms) and not s.failure]
    single = next((s for s in of_mechanisms if len(s.names) == 1), None)
    parts = (s for s in sets if s.names in alone or s is single or s in of_mechanisms[:1])
    part = next((part for part in parts if part.is_open), None)
    if part is None and single is not None and single.names not in expanded:
        part = single
    if part is None and nameless:
        singles = (s for s in sets if len(s.names) == 1 == len(s.mechanisms) and s.is_open)
        part = _first_that_may_be_best(singles, sets, belief("fits.part"))
    return part


def _rival_without_a_name(decision: Decision, sets: Sequence[WeightedSet]) -> WeightedSet | None:
    """The likeliest set without any mechanism before one is named; None if it was fitted, or is too far behind.

    The name has the fit, and the places about it, that made it the likeliest. The unknown is as far from linear, and a
    name must not be right only because that was left as the linear model about the base has it.
    """
    if decision.verdict not in (NAMED, NAMED_AND_REST):
        return None
    rival = next((s for s in sets if UNKNOWN in s.names and not s.mechanisms and not s.failure), None)
    if rival is None or not rival.is_open:
        return None
    best, other = (s.hypothesis.log_evidence + s.hypothesis.log_prior for s in (sets[0], rival))
    return rival if best - other < belief("fits.moved") else None


def _may_be_regretted(candidate: WeightedSet, sets: Sequence[WeightedSet], decision: Decision) -> bool:
    """Whether another verdict would be better by more than a fit is worth, if the fit changed the set's evidence."""
    error = candidate.linear_error
    for change in (belief("fits.moved"),) if candidate.may_move else (-error, error):
        best, losses = _decide(sets, candidate, change)
        if losses.get(decision, np.inf) - losses[best] > belief("fits.regret"):
            return True
    return False


def _subset_first(
    chosen: WeightedSet, sets: Sequence[WeightedSet], expanded: Collection[frozenset[str]]
) -> WeightedSet:
    """The set itself, or its most probable subset of one cause less that is to be fitted, or expanded, before it.

    Two causes that are probable in the linear model about the base are often one whose effect is not linear.
    """
    count = len(chosen.names) - 1
    subsets = [candidate for candidate in sets if candidate.names < chosen.names and len(candidate.names) == count]
    subsets = [candidate for candidate in subsets if candidate.acting and not candidate.failure]
    if chosen.refit is not None or not subsets or any(candidate.names in expanded for candidate in subsets):
        return chosen
    return subsets[0]
