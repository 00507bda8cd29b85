"""What every effect has."""

from __future__ import annotations

import abc
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from referee.problem import Problem

Floats = NDArray[np.float64]
Place = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Effect(abc.ABC):
    """Something that acts in a truth and that its case does not declare.

    Parameters
    ----------
    size : float
        How much of it, in `unit`; above zero.
    """

    #: Name of the tool's mechanism; of what is outside its dictionary a name of our own.
    kind: ClassVar[str]
    unit: ClassVar[str]
    #: Smallest and largest plausible size.
    limits: ClassVar[tuple[float, float]]
    #: Displacement grows about with this power of the size.
    power: ClassVar[float] = 1.0
    #: Whether it acts by forces beside a tangent that stays as it is, to first order.
    forces: ClassVar[bool] = False
    #: Names that are right as well.
    also: ClassVar[tuple[str, ...]] = ()
    #: The tool's parameter that the size is an amount of, empty if there is none that means the same, and how many of
    #: its SI unit the amount has for one of ours.
    parameter: ClassVar[str] = ""

    size: float

    @abc.abstractmethod
    def act(self, problem: Problem) -> Problem:
        """The problem with the effect."""

    def resized(self, size: float) -> Self:
        """The same effect of another size, within its limits."""
        return replace(self, size=float(np.clip(size, *self.limits)))

    def course(self, times: Sequence[float]) -> Floats:
        """About which part (times,) of it is seen at each time [s]; of one that does not change (1,)."""
        return np.ones(1)

    @property
    def spanning(self) -> tuple[Self, ...]:
        """Effects of which this one is a sum, whatever its size and direction, where its place is known."""
        return (self,)

    @property
    def amount(self) -> float | None:
        """What the tool's parameter should be [SI], None if there is nothing to compare with."""
        return None

    @property
    def where(self) -> Place | None:
        """Middle of a local effect [m]."""
        return getattr(self, "centre", None)

    def described(self) -> dict[str, Any]:
        """Everything of it, for the label."""
        return {
            "kind": self.kind,
            "unit": self.unit,
            "parameter": self.parameter,
            "amount": self.amount,
            "where_m": self.where,
            "also": list(self.also),
            **{name: _plain(value) for name, value in asdict(self).items()},
        }


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def hill(points: Floats, centre: Place, radius: float) -> Floats:
    """A smooth hill (...) of height 1 at the centre that ends at the radius: ``(1 - (r/R)^2)^2``."""
    square = ((points - np.asarray(centre)) ** 2).sum(axis=-1) / radius**2
    return np.where(square < 1.0, (1.0 - square) ** 2, 0.0)


def plateau(points: Floats, centre: Place, radius: float) -> Floats:
    """A ball (...): 1 inside the radius, 0 beyond it, over about a tenth of it."""
    r = np.linalg.norm(points - np.asarray(centre), axis=-1)
    return 0.5 * (1.0 - np.tanh((r / radius - 1.0) / 0.1))


def unit(vector: Floats) -> Floats:
    """A vector of length 1."""
    return vector / np.linalg.norm(vector)
