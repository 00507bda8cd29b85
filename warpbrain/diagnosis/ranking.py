"""Every cause by itself: how probable, how large, where, and how visible."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.confirming import Confirming
from warpbrain.diagnosis.held_out import HeldOut
from warpbrain.diagnosis.locating import ball_of
from warpbrain.diagnosis.result import Ranked
from warpbrain.inference import Cause, GaussianModel, Kind
from warpbrain.inference.blocks import Blocks
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.hypotheses import HypothesisSearch
from warpbrain.worlds.body.parameters import scanned_values, values_of
from warpbrain.worlds.body.weighted_set import WeightedSet

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Member:
    """A mechanism of a set: its effect there, its columns, coefficients and their covariance."""

    effect: Effect
    own: slice
    mean: Floats
    covariance: Floats


class Ranking:
    """Ranks the causes of one search.

    Parameters
    ----------
    search : HypothesisSearch
    confirming : Confirming
    """

    def __init__(self, search: HypothesisSearch, confirming: Confirming) -> None:
        self._search, self._confirming = search, confirming
        self._sets = list(zip(search.weighted_sets, search.probabilities.tolist(), strict=True))

    def all(self) -> tuple[Ranked, ...]:
        """Every cause as it is in the most probable set that has it, the most probable first."""
        found = []
        for cause in self._search.causes.causes:
            chance = sum(p for one, p in self._sets if cause.name in one.names)
            best = next((one for one, _ in self._sets if cause.name in one.names), None)
            if best is not None:
                found.append(self._ranked(cause, best, chance))
        return tuple(sorted(found, key=lambda one: (-one.probability, -one.log_evidence)))

    def named(self, one: WeightedSet, names: tuple[str, ...]) -> tuple[Ranked, ...]:
        """Mechanisms as they are in one set."""
        chances = {name: sum(p for own, p in self._sets if name in own.names) for name in names}
        return tuple(self._ranked(self._search.causes.named(name), one, chances[name]) for name in names)

    def _ranked(self, cause: Cause, one: WeightedSet, chance: float) -> Ranked:
        alone, nothing = self._search.get((cause.name,)), self._search.get(())
        assert nothing is not None
        log_evidence = float("-inf") if alone is None else alone.hypothesis.log_evidence
        gained = log_evidence - nothing.hypothesis.log_evidence
        if cause.kind is not Kind.PHYSICS:
            why = "no physics" if cause.kind is Kind.NOT_PHYSICS else ""
            return Ranked(cause.name, False, gained, chance, 0.0, None, (), None, None, "", why)
        member = _member(one, cause.name)
        weights = self._weights(cause, one)
        scanned = self._search.causes.effects[cause.name]
        values = values_of(member.effect, member.mean, member.covariance)
        known = {value.name for value in values}
        values += tuple(value for value in scanned_values(scanned, weights) if value.name not in known)
        centre, radius = _place(member, scanned, weights)
        change = None
        if alone is not None and alone.refit is not None:
            way: HeldOut = self._confirming.way(alone)
            with_it, without = (self._confirming.predict(own, way) for own in (alone, nothing))
            change = way.error(with_it) - way.error(without)
        why = "" if one.refit is not None else "less probable than what was fitted"
        return Ranked(
            cause.name,
            True,
            gained,
            chance,
            _detectability(nothing, one, member),
            change,
            values,
            centre,
            radius,
            member.effect.proposed.region,
            why,
        )

    def _weights(self, cause: Cause, one: WeightedSet) -> Floats:
        """Probabilities (p,) of the places of a scan beside all else that acts in a set."""
        from scipy.special import softmax

        model, residual = about_base(self._search, one, cause.name)
        blocks = Blocks(model, residual, [cause])
        logs = np.logaddexp.reduce(blocks.log_factors() + blocks.log_weights, axis=1)
        return np.asarray(softmax(logs))


def about_base(search: HypothesisSearch, one: WeightedSet, name: str) -> tuple[GaussianModel, Floats]:
    """The model and residual (n,) of all else that acts in a set but one mechanism, linear about the base.

    There the columns of all its places are known; about a fit, far from the base, they are others.
    """
    base, model = search.base, one.marginal.model
    others = [effect for kind, effect in zip(one.mechanisms, one.effects, strict=True) if kind != name]
    columns = np.column_stack([base.nuisances.columns, *(effect.columns for effect in others), one.marginal.excess])
    residual = base.residual - sum((effect.mean for effect in others), start=np.zeros(len(base.residual)))
    return GaussianModel(base.model.noise_factor, columns, model.scale), residual


def _member(one: WeightedSet, name: str) -> _Member:
    number = one.mechanisms.index(name)
    at = one.columns.shape[1] - sum(effect.columns.shape[1] for effect in one.effects)
    for effect in one.effects[:number]:
        at += effect.columns.shape[1]
    effect = one.effects[number]
    mean, covariance = one.coefficients[number]
    return _Member(effect, slice(at, at + effect.columns.shape[1]), mean, covariance)


def _place(member: _Member, scanned: tuple[Effect, ...], weights: Floats) -> tuple[Floats | None, float | None]:
    """Where it acts, and the radius of a ball that holds 90 % of where it may."""
    proposed = member.effect.proposed
    if proposed.centre is None:
        return None, None
    located = [k for k, effect in enumerate(scanned) if effect.proposed.centre is not None]
    total = float(weights[located].sum())
    if not total > 0.0:
        # about the base it would rather act everywhere
        return proposed.centre, proposed.radius
    sites = np.array([scanned[k].proposed.centre for k in located])
    centre, radius = ball_of(sites, weights[located] / total)
    return centre, max(radius, float(proposed.radius or 0.0))


def _detectability(nothing: WeightedSet, one: WeightedSet, member: _Member) -> float:
    """Of what it changes, from nothing to the best point by the trapezium rule, beside all else that acts."""
    # at the best point tissue explains how large it is, which says nothing of whether it is seen
    count = len(nothing.columns.T) - nothing.linear_columns.shape[1]
    others = np.delete(one.columns, np.r_[member.own], axis=1)[:, count:]
    columns = np.column_stack([nothing.columns[:, :count], others])
    model = GaussianModel(nothing.marginal.model.noise_factor, columns, one.marginal.scale)
    effect, z, own = member.effect, member.mean, one.columns[:, member.own]
    # what is there or not, or takes its time, is solved as a whole: it has no line from nothing to where it is
    whole = effect.proposed.is_there_or_not or effect.proposed.changes_in_time
    change = effect.mean + effect.columns @ z if whole else 0.5 * (effect.columns + own) @ effect.offset(z)
    return float(np.linalg.norm(model.standardised(change)))
