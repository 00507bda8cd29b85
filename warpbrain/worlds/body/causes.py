"""Causes of a body: mechanisms at their places, unknown fields, and what is no physics."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference import Cause, GaussianModel, Kind, Place
from warpbrain.inference.beliefs import belief, beliefs
from warpbrain.inference.causes import Member
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.dictionary import Candidates
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.time_courses import factor_of_rows, main_courses

UNKNOWN = "unknown"


@dataclass(frozen=True, eq=False)
class BodyCauses:
    """Causes, and the effects of mechanisms at their places."""

    causes: tuple[Cause, ...]
    effects: Mapping[str, tuple[Effect, ...]]  # of each kind, by place

    def named(self, name: str) -> Cause:
        """A cause by its name."""
        return next(cause for cause in self.causes if cause.name == name)

    def effect(self, member: Member) -> Effect | None:
        """The effect of a mechanism at a place with a size; None if the cause is no mechanism."""
        cause = self.causes[member.cause]
        if cause.kind is not Kind.PHYSICS:
            return None
        return scaled(self.effects[cause.name][member.place], float(cause.sizes[member.size]))

    def columns(self, member: Member) -> Floats:
        """Columns (n, k) of one standard deviation."""
        cause = self.causes[member.cause]
        return cause.sizes[member.size] * cause.places[member.place].columns

    def mean(self, member: Member) -> Floats | float:
        """Expected change of each row (n,)."""
        mean = self.causes[member.cause].places[member.place].mean
        return 0.0 if mean is None else mean


def visible(causes: BodyCauses, model: GaussianModel) -> BodyCauses:
    """Those that would change what was recorded beside noise and nuisances, were they as large as is believed.

    A set with a cause that changes nothing is as probable as without it: many of them would share the probability of
    what acts, and tell of nothing. Their sizes are believed, but no verdict depends on them.

    `model`: of the rows without them.
    """
    least = belief("checks.invisible")
    return replace(causes, causes=tuple(cause for cause in causes.causes if _length(cause, model) > least))


def _length(cause: Cause, model: GaussianModel) -> float:
    """Of the largest change by one standard deviation of the largest size, in standard deviations of the model."""
    blocks = [float(np.max(cause.sizes)) * place.columns for place in cause.places]
    blocks += [place.mean[:, None] for place in cause.places if place.mean is not None]
    if not blocks:
        return 0.0
    return float(np.linalg.norm(model.standardised(np.concatenate(blocks, axis=1)), axis=0).max(initial=0.0))


def scaled(effect: Effect, size: float) -> Effect:
    """An effect whose coefficients have a prior that is so many times as wide."""
    if size == 1.0:
        return effect
    return replace(
        effect, proposal=replace(effect.proposed, sd=size * effect.proposed.sd), columns=size * effect.columns
    )


def causes_of(base: Base, candidates: Candidates) -> BodyCauses:
    """The causes at a base."""
    sizes, not_physics_sizes = beliefs("causes.sizes"), beliefs("causes.not_physics_sizes")
    unit_sizes = np.ones(len(sizes))
    causes: list[Cause] = []
    for kind, of_kind in candidates.effects.items():
        places = tuple(Place(effect.columns, effect.mean if effect.mean.any() else None) for effect in of_kind)
        if of_kind[0].proposal is None:
            causes.append(
                Cause(kind, places, math.log(belief("causes.not_physics")), not_physics_sizes, Kind.NOT_PHYSICS)
            )
            continue
        # a mechanism with an expected size, such as a weight, has that one
        has_mean = any(place.mean is not None for place in places)
        causes.append(Cause(kind, places, math.log(belief("causes.mechanism")), unit_sizes if has_mean else sizes))
    # setting in at any recorded time
    courses = main_courses(base.states.times)
    factors = [factor_of_rows(course, base.at.sensors) for course in courses]
    causes.append(unknown_cause(base, [factor for factor in factors if factor.any()]))
    return BodyCauses(tuple(causes), candidates.effects)


def unknown_cause(base: Base, factors: Sequence[Floats]) -> Cause:
    """Unknown fields of every kind and length, with each of some factors (n,) on the rows."""
    noise = base.typical_noise
    places = tuple(Place(noise * factor[:, None] * columns) for columns in base.unknown.values() for factor in factors)
    return Cause(UNKNOWN, places, math.log(belief("causes.unknown")), beliefs("unknown.sizes"), Kind.UNKNOWN)
