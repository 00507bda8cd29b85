"""Everything that may act on a body as causes, alike: mechanisms at their places, fields without a name, no physics."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warpbrain.inference import Cause, Kind, Place
from warpbrain.inference.beliefs import belief, beliefs
from warpbrain.inference.hypothesis import Member
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.dictionary import Candidates
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.time_courses import main_courses

Floats = NDArray[np.float64]

UNKNOWN = "unknown"


@dataclass(frozen=True, eq=False)
class BodyCauses:
    """Causes, and the effects that places of mechanisms stand for.

    Attributes
    ----------
    causes : tuple of Cause
    effects : mapping of str to tuple of Effect
        Of each mechanism, by place.
    """

    causes: tuple[Cause, ...]
    effects: Mapping[str, tuple[Effect, ...]]

    def named(self, name: str) -> Cause:
        """A cause by its name."""
        return next(cause for cause in self.causes if cause.name == name)

    def effect(self, member: Member) -> Effect | None:
        """The effect of a mechanism at a place with a size; None of what is none."""
        cause = self.causes[member.cause]
        if cause.kind is not Kind.PHYSICS:
            return None
        return scaled(self.effects[cause.name][member.place], float(cause.sizes[member.size]))

    def columns(self, member: Member) -> Floats:
        """Columns (n, k) of one standard deviation."""
        cause = self.causes[member.cause]
        return cause.sizes[member.size] * cause.places[member.place].columns

    def mean(self, member: Member) -> Floats | float:
        """What is expected of it (n,)."""
        mean = self.causes[member.cause].places[member.place].mean
        return 0.0 if mean is None else mean


def scaled(effect: Effect, size: float) -> Effect:
    """An effect whose coefficients are so many times as wide beforehand."""
    if size == 1.0:
        return effect
    return replace(
        effect, proposal=replace(effect.proposed, sd=size * effect.proposed.sd), columns=size * effect.columns
    )


def causes_of(base: Base, candidates: Candidates) -> BodyCauses:
    """The causes at a base."""
    sizes, wrong = beliefs("causes.sizes"), beliefs("causes.not_physics_sizes")
    as_it_is = np.ones(len(sizes))
    causes: list[Cause] = []
    effects: dict[str, tuple[Effect, ...]] = {}
    for kind, numbers in candidates.of_kind.items():
        own = tuple(candidates.effects[number] for number in numbers.tolist())
        places = tuple(Place(one.columns, one.mean if one.mean.any() else None) for one in own)
        if kind in candidates.alternatives:
            causes.append(Cause(kind, places, math.log(belief("causes.not_physics")), wrong, Kind.NOT_PHYSICS))
            continue
        # what is expected to be of a size, such as a weight, has that one
        known = any(place.mean is not None for place in places)
        causes.append(Cause(kind, places, math.log(belief("causes.mechanism")), as_it_is if known else sizes))
        effects[kind] = own
    # from every recorded time on
    courses = main_courses(base.states.times)
    causes.append(unknown_cause(base, [course.factor(base.at.sensors.times) for course in courses]))
    return BodyCauses(tuple(causes), effects)


def unknown_cause(base: Base, factors: Sequence[Floats]) -> Cause:
    """Fields of every kind and length, each with every one of some factors (n,) on the rows."""
    noise = base.typical_noise
    places = tuple(Place(noise * factor[:, None] * columns) for columns in base.unknown.values() for factor in factors)
    return Cause(UNKNOWN, places, math.log(belief("causes.unknown")), beliefs("unknown.sizes"), Kind.UNKNOWN)
