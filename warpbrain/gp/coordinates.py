"""The parameters of a law as numbers that a distribution is written in: the log shear modulus, and the shape."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import TYPE_CHECKING

from warpbrain.errors import InputError

if TYPE_CHECKING:
    from warpbrain.physics.laws import Law


@dataclass(frozen=True)
class Coordinate:
    """One number of a law: its name with the unit, where it ends, and whether its signs are kinds of their own.

    Between positive and negative values of a `signed` one there are none.
    """

    name: str
    low: float = -math.inf
    high: float = math.inf
    signed: bool = False


_MODULUS = Coordinate("ln(mu0 / Pa)")
_COORDINATES = {
    "neo-hookean": (_MODULUS,),
    "mooney-rivlin": (_MODULUS, Coordinate("C2 / (C1 + C2)", 0.0, 1.0)),
    "ogden": (_MODULUS, Coordinate("alpha", signed=True)),
}


def coordinates(law: str) -> tuple[Coordinate, ...]:
    """Of a law by its name in `case.toml`; Ogden's has one term.

    Raises
    ------
    InputError
        If there is no such law.
    """
    if law not in _COORDINATES:
        raise InputError(f"law '{law}': expected one of {', '.join(_COORDINATES)}")
    return _COORDINATES[law]


def to_coordinates(law: Law) -> tuple[float, ...]:
    """Coordinates of a law."""
    from warpbrain.physics.laws import MooneyRivlin, NeoHookean, Ogden

    modulus = math.log(law.shear_modulus)
    match law:
        case NeoHookean():
            return (modulus,)
        case MooneyRivlin(C1=C1, C2=C2):
            return modulus, C2 / (C1 + C2)
        case Ogden(alpha=(alpha,)):
            return modulus, alpha
    raise InputError(f"{law}: has no coordinates: expected neo-Hookean, Mooney-Rivlin or Ogden with one term")


def from_coordinates(law: str, values: Sequence[float]) -> Law:
    """The law of its coordinates.

    Raises
    ------
    InputError
        If there are not as many as the law has, or there is no such law.
    """
    from warpbrain.physics.laws import MooneyRivlin, NeoHookean, Ogden

    known = coordinates(law)
    if len(values) != len(known):
        names = ", ".join(coordinate.name for coordinate in known)
        raise InputError(f"{law}: found {len(values)} numbers, expected {len(known)}: {names}")
    modulus = math.exp(values[0])
    if law == "neo-hookean":
        return NeoHookean(modulus)
    if law == "mooney-rivlin":
        return MooneyRivlin(0.5 * modulus * (1.0 - values[1]), 0.5 * modulus * values[1])
    return Ogden((2.0 * modulus / values[1],), (values[1],))


def laws_from(names: Sequence[str], values: Sequence[float]) -> tuple[Law, ...]:
    """Laws by their names, of the coordinates of all of them, one after the other."""
    ends = list(accumulate(len(coordinates(name)) for name in names))
    return tuple(
        from_coordinates(name, values[end - len(coordinates(name)) : end])
        for name, end in zip(names, ends, strict=True)
    )
