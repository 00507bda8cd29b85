"""Numbers that a mechanism can be differentiated by, each by its place, and the same mechanism with other ones.

A `parameter` of a mechanism is one such number if its kind is a number, and several if it is a position, a vector or
numbers. A number that is none (no ball, so no radius) is left out, and so is a setting of the method
(`ParameterSpec.method`). What switches from one thing to another has no derivative.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from warpbrain.arrays import Floats
from warpbrain.errors import InputError
from warpbrain.physics.mechanism import NUMBERS, Mechanism, ParameterSpec

#: Over what length [m] something changes that depends on where it is, at most.
_LENGTH = 0.01
#: Over what angle [rad] something changes that depends on a direction, at most.
_TURN = 0.05
_AXES = "xyz"


@dataclass(frozen=True)
class Continuous:
    """A number of a mechanism."""

    kind: str  # of the mechanism
    key: str  # name of the parameter
    component: int | None  # of a position, a vector or numbers
    spec: ParameterSpec

    @property
    def name(self) -> str:
        """For people: mechanism, parameter and component."""
        if self.component is None:
            return f"{self.kind} {self.key}"
        part = f"{self.component + 1}" if self.spec.kind == "numbers" else _AXES[self.component]
        return f"{self.kind} {self.key} {part}"

    def value(self, mechanism: Mechanism) -> float:
        """What it is [SI]."""
        number: Any = getattr(mechanism, self.key)
        return float(number if self.component is None else number[self.component])

    def scale(self, mechanism: Mechanism) -> float:
        """By how much it must change to change much [SI]: what a step of a difference is relative to.

        Its own size, or what is expected of it where it is zero; the size of the whole of a vector, or a small part of
        it where only the direction counts, since a fluid's surface turns with it; at most 1 cm of a length, which
        regions, patches and fluid levels are as smooth as; and no more than the distance to a limit.
        A limit that a value may lie on is written a little beyond it, and formulas go on there.
        """
        spec, value = self.spec, self.value(mechanism)
        whole = getattr(mechanism, self.key)
        length = spec.kind == "position" or spec.unit == "mm"
        if spec.kind == "position":
            return _LENGTH
        size = abs(value)
        if spec.kind == "vector":
            size = (1.0 if spec.unit else _TURN) * float(np.linalg.norm(whole))
        expected = spec.expectation
        if size == 0.0 and expected is not None:
            size = 0.5 * abs(expected.quantile(0.84) - expected.quantile(0.16)) * spec.si
        size = size or spec.size * spec.si
        if length:
            size = min(size, _LENGTH)
        for limit in (spec.above, spec.below):
            distance = abs(value - limit * spec.si)
            if math.isfinite(limit) and distance > 1e-9 * size:
                size = min(size, distance)
        return size


def continuous(mechanism: Mechanism) -> tuple[Continuous, ...]:
    """Every number that a mechanism can be differentiated by, in the order of its fields."""
    places: list[Continuous] = []
    for key, spec in mechanism.parameters().items():
        value: Any = getattr(mechanism, key)
        if value is None or spec.method or spec.kind not in NUMBERS:
            continue
        if spec.kind == "number":
            places.append(Continuous(mechanism.kind, key, None, spec))
        else:
            places += [Continuous(mechanism.kind, key, component, spec) for component in range(len(value))]
    return tuple(places)


def numbers_of(mechanisms: Sequence[Mechanism]) -> Floats:
    """The numbers of mechanisms, one after the other, shape (p,) [SI]."""
    return np.array([place.value(mechanism) for mechanism in mechanisms for place in continuous(mechanism)])


def scales_of(mechanisms: Sequence[Mechanism]) -> Floats:
    """The scale of each of these numbers, shape (p,); see `Continuous.scale`."""
    return np.array([place.scale(mechanism) for mechanism in mechanisms for place in continuous(mechanism)])


def with_numbers(mechanisms: Sequence[Mechanism], numbers: ArrayLike) -> tuple[Mechanism, ...]:
    """The same mechanisms with other numbers (p,), in the order of `numbers_of` [SI].

    `InputError` if there are more or fewer than the mechanisms have, or a mechanism refuses them.
    """
    given = np.asarray(numbers, dtype=np.float64)
    places = [continuous(mechanism) for mechanism in mechanisms]
    count = sum(map(len, places))
    if given.shape != (count,):
        raise InputError(f"mechanisms: found {given.size} numbers, expected {count}")
    made, at = [], 0
    for mechanism, its_places in zip(mechanisms, places, strict=True):
        values: dict[str, Any] = {}
        for place, number in zip(its_places, given[at : at + len(its_places)].tolist(), strict=True):
            if place.component is None:
                values[place.key] = number
            else:
                values[place.key] = (*values.get(place.key, ()), number)
        at += len(its_places)
        made.append(replace(mechanism, **values) if its_places else mechanism)
    return tuple(made)
