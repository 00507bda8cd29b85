"""The parameters of laws as the numbers that a distribution is written in (`warpbrain.physics.laws.law.Coordinate`)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import accumulate
from typing import TYPE_CHECKING, Any

from warpbrain.errors import InputError

if TYPE_CHECKING:
    from warpbrain.physics.laws import Law
    from warpbrain.physics.laws.law import Coordinate


def coordinates(law: str) -> tuple[Coordinate, ...]:
    """Of a law by its name in `case.toml`, Ogden's of one term; `InputError` if none that has a prior is called so."""
    from warpbrain.physics.laws import LAWS

    known = {name: kind.coordinates for name, kind in LAWS.items() if kind.coordinates}
    if law not in known:
        raise InputError(f"law '{law}': expected one of {', '.join(known)}")
    return known[law]


def to_coordinates(law: Law) -> tuple[float, ...]:
    """Coordinates of a law; `InputError` if it has none, or several terms."""
    coordinates(law.name)
    return math.log(law.shear_modulus), *law.shape


def from_coordinates(law: str, values: Sequence[float]) -> Law:
    """The law of its coordinates; `InputError` if there are not as many as it has, or there is no such law."""
    from warpbrain.physics.laws import LAWS

    known = coordinates(law)
    if len(values) != len(known):
        names = ", ".join(coordinate.name for coordinate in known)
        raise InputError(f"{law}: found {len(values)} numbers, expected {len(known)}: {names}")
    kind: Any = LAWS[law]
    return kind.of_shear_modulus(math.exp(values[0]), *values[1:])


def laws_from(names: Sequence[str], values: Sequence[float]) -> tuple[Law, ...]:
    """Laws by their names, of the coordinates of all of them, one after the other."""
    ends = list(accumulate(len(coordinates(name)) for name in names))
    return tuple(
        from_coordinates(name, values[end - len(coordinates(name)) : end])
        for name, end in zip(names, ends, strict=True)
    )
