"""Effects that no mechanism of the tool describes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from referee.effects.effect import Effect, Floats, Place, unit
from referee.effects.forces import adding, patch
from referee.problem import Problem


@dataclass(frozen=True, kw_only=True)
class Tether(Effect):
    """A patch of the surface is drawn to a point outside with `size` [N]; the pull follows it.

    Parameters
    ----------
    centre : (x, y, z)
        Of the patch [m].
    radius : float
        [m]
    anchor : (x, y, z)
        The point outside [m].
    """

    kind: ClassVar[str] = "tether"
    unit: ClassVar[str] = "N"
    limits: ClassVar[tuple[float, float]] = (0.005, 2.0)
    forces: ClassVar[bool] = True
    #: A force on a patch of the surface is what it is; that it points to one place shows at one load nowhere.
    also: ClassVar[tuple[str, ...]] = ("traction",)

    centre: Place
    radius: float
    anchor: Place

    def act(self, problem: Problem) -> Problem:
        share = patch(problem, self.centre, self.radius)
        points, anchor = problem.body.points, np.asarray(self.anchor)

        def pull(u: Floats) -> Floats:
            along = anchor - (points + u)
            return self.size * share[:, None] * along / np.linalg.norm(along, axis=1, keepdims=True)

        return adding(problem, pull)


@dataclass(frozen=True, kw_only=True)
class PreStress(Effect):
    """A slab is under deviatoric stress before anything is done: tension of `size` [Pa] along an axis.

    Parameters
    ----------
    centre : (x, y, z)
    normal : (x, y, z)
        Of the slab.
    thickness : float
        [m]
    axis : (x, y, z)
        Of the tension.
    """

    kind: ClassVar[str] = "pre-stress"
    unit: ClassVar[str] = "Pa"
    limits: ClassVar[tuple[float, float]] = (10.0, 1500.0)
    forces: ClassVar[bool] = True
    also: ClassVar[tuple[str, ...]] = ("residual-stress",)

    centre: Place
    normal: Place
    thickness: float
    axis: Place

    def act(self, problem: Problem) -> Problem:
        a, n = unit(np.asarray(self.axis)), unit(np.asarray(self.normal))
        places = problem.body.region[1]
        within = np.abs((places - np.asarray(self.centre)) @ n) < 0.5 * self.thickness
        stress = self.size * within[..., None, None] * (np.outer(a, a) - np.eye(3) / 3.0)
        return replace(problem, stress=stress if problem.stress is None else problem.stress + stress)


@dataclass(frozen=True, kw_only=True)
class Wire(Effect):
    """A taut wire draws two patches of the surface towards each other with `size` [N].

    Parameters
    ----------
    centre, other : (x, y, z)
        Of the patches [m].
    radius : float
        [m]
    """

    kind: ClassVar[str] = "wire"
    unit: ClassVar[str] = "N"
    limits: ClassVar[tuple[float, float]] = (0.005, 2.0)
    forces: ClassVar[bool] = True
    #: Each end is a force on a patch of the surface, as that of a tether is.
    also: ClassVar[tuple[str, ...]] = ("traction",)

    centre: Place
    other: Place
    radius: float

    def act(self, problem: Problem) -> Problem:
        here, there = (patch(problem, place, self.radius) for place in (self.centre, self.other))

        def pull(u: Floats) -> Floats:
            x = problem.body.points + u
            along = unit(there @ x - here @ x)
            return self.size * (here - there)[:, None] * along

        return adding(problem, pull)
