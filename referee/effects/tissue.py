"""Effects of the tissue itself: it has swollen, is harder somewhere, has another law, or creeps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from referee.effects.effect import Effect, Floats, Place, plateau
from referee.law import Ogden
from referee.problem import Problem


@dataclass(frozen=True, kw_only=True)
class Swelling(Effect):
    """Tissue would have another volume, larger (`sign` 1) or smaller (-1) by `size` of it.

    Parameters
    ----------
    centre : (x, y, z) or None
        Of a ball; None: all tissue.
    radius : float
        [m]
    """

    kind: ClassVar[str] = "swelling"
    unit: ClassVar[str] = "1"
    limits: ClassVar[tuple[float, float]] = (0.001, 0.4)
    forces: ClassVar[bool] = True
    parameter: ClassVar[str] = "amount"

    sign: int
    centre: Place | None
    radius: float

    def act(self, problem: Problem) -> Problem:
        where = np.ones(len(problem.mu))
        if self.centre is not None:
            where = plateau(problem.body.centroids, self.centre, self.radius)
        return replace(problem, growth=problem.growth + np.log1p(self.sign * self.size * where)[:, None])

    @property
    def amount(self) -> float:
        return self.sign * self.size


@dataclass(frozen=True, kw_only=True)
class Inclusion(Effect):
    """A ball that is stiffer (`sign` 1) or softer (-1) by a factor ``exp(size)``."""

    kind: ClassVar[str] = "inclusion"
    unit: ClassVar[str] = "1"
    limits: ClassVar[tuple[float, float]] = (0.1, 2.2)
    power: ClassVar[float] = 0.8
    parameter: ClassVar[str] = "ratio"

    sign: int
    centre: Place
    radius: float

    def act(self, problem: Problem) -> Problem:
        factor = np.exp(self.sign * self.size * plateau(problem.body.centroids, self.centre, self.radius))[:, None]
        return replace(problem, mu=problem.mu * factor, bulk=problem.bulk * factor)

    @property
    def amount(self) -> float:
        return float(np.exp(self.sign * self.size))


@dataclass(frozen=True, kw_only=True)
class Asymmetry(Effect):
    """Tissue resists compression much more than tension: Ogden's law of the exponent ``-size``."""

    kind: ClassVar[str] = "asymmetry"
    unit: ClassVar[str] = "1"
    limits: ClassVar[tuple[float, float]] = (6.0, 28.0)
    parameter: ClassVar[str] = "exponent"

    def act(self, problem: Problem) -> Problem:
        return replace(problem, law=Ogden((1.0,), (-self.size,)))

    @property
    def amount(self) -> float:
        return -self.size


@dataclass(frozen=True, kw_only=True)
class Viscoelasticity(Effect):
    """Stress relaxes: branches whose moduli are `size` together, relative to what is left in the end.

    What it does at a time is found by `referee.creep`; here it acts as at once after the load.

    Parameters
    ----------
    times : tuple of float
        Relaxation times [s], of equal share.
    """

    kind: ClassVar[str] = "viscoelasticity"
    unit: ClassVar[str] = "1"
    limits: ClassVar[tuple[float, float]] = (0.05, 5.0)
    parameter: ClassVar[str] = "moduli"

    times: tuple[float, ...]

    def act(self, problem: Problem) -> Problem:
        return replace(problem, factor=1.0 + self.size)

    def course(self, times: Sequence[float]) -> Floats:
        # a solid with one such branch creeps in the time in which it relaxes, times the moduli together
        creeping = [np.exp(-np.asarray(times) / (tau * (1.0 + self.size / len(self.times)))) for tau in self.times]
        return np.mean(creeping, axis=0)

    @property
    def amount(self) -> float:
        return self.size
