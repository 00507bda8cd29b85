"""Forces: weight where fluid has drained, pressure of fluid, and something that presses or pulls on the surface."""

from __future__ import annotations

import abc
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from referee.body import Body
from referee.effects.effect import Effect, Floats, Place, hill, unit
from referee.problem import Load, Problem

#: Loss of buoyancy above the fluid's surface [N/m3]: its density times standard gravity.
BUOYANCY = 1007.0 * 9.81


def adding(problem: Problem, load: Load) -> Problem:
    """The problem with one more load."""
    return replace(problem, loads=(*problem.loads, load))


@dataclass(frozen=True, kw_only=True)
class BodyForce(Effect):
    """A force on the volume that does not depend on the displacement."""

    forces: ClassVar[bool] = True

    @abc.abstractmethod
    def density(self, body: Body) -> Floats:
        """Force by volume (m, q, 3) [N/m3] at the integration points of a body."""

    def act(self, problem: Problem) -> Problem:
        body = problem.body
        volumes, _ = body.region
        local = np.einsum("aq,eqi->eai", body.shapes, self.density(body) * volumes[..., None])
        force = problem.gathered(local)
        return adding(problem, lambda u: force)


@dataclass(frozen=True, kw_only=True)
class Gravity(BodyForce):
    """Fluid has drained to `size` [m] below the highest point.

    Parameters
    ----------
    direction : (x, y, z)
        Down; up to eight degrees from where the case says.
    declared : (x, y, z)
        Where the case says.
    height : float
        Of the body along the declared direction [m].
    """

    kind: ClassVar[str] = "gravity"
    unit: ClassVar[str] = "m"
    limits: ClassVar[tuple[float, float]] = (0.002, 0.12)
    power: ClassVar[float] = 2.0
    parameter: ClassVar[str] = "csf_level"

    direction: Place
    declared: Place
    height: float

    def density(self, body: Body) -> Floats:
        down = unit(np.asarray(self.direction))
        middle = body.points.mean(axis=0)
        depth = (body.region[1] - middle) @ down - ((body.points - middle) @ down).min()
        dry = 1.0 / (1.0 + np.exp(np.clip((depth - self.size) / 0.0005, -50.0, 50.0)))
        return BUOYANCY * dry[..., None] * down

    @property
    def amount(self) -> float:
        return self.height - self.size


@dataclass(frozen=True, kw_only=True)
class Pressure(Effect):
    """Fluid presses (`sign` 1) on the walls of the ventricles or draws them in (-1), and follows them."""

    kind: ClassVar[str] = "pressure"
    unit: ClassVar[str] = "Pa"
    limits: ClassVar[tuple[float, float]] = (3.0, 600.0)
    forces: ClassVar[bool] = True
    parameter: ClassVar[str] = "value"

    sign: int

    def act(self, problem: Problem) -> Problem:
        faces = problem.body.faces(problem.body.mesh.node_sets["ventricle"])
        value = self.sign * self.size
        return adding(problem, lambda u: -value * faces.spread(faces.vectors(problem.body.points + u)))

    @property
    def amount(self) -> float:
        return self.sign * self.size


@dataclass(frozen=True, kw_only=True)
class Traction(Effect):
    """Something presses or pulls on a patch of the surface.

    Parameters
    ----------
    centre : (x, y, z)
    radius : float
        [m]
    direction : (x, y, z)
    """

    kind: ClassVar[str] = "traction"
    unit: ClassVar[str] = "Pa"
    limits: ClassVar[tuple[float, float]] = (30.0, 8000.0)
    forces: ClassVar[bool] = True
    parameter: ClassVar[str] = "value"

    centre: Place
    radius: float
    direction: Place

    def act(self, problem: Problem) -> Problem:
        outer = problem.body.outer
        weight = self.size * hill(outer.places, self.centre, self.radius) * outer.areas
        force = outer.spread(weight[..., None] * unit(np.asarray(self.direction)))
        return adding(problem, lambda u: force)

    @property
    def spanning(self) -> tuple[Self, ...]:
        return tuple(replace(self, direction=axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))


def patch(problem: Problem, centre: Place, radius: float) -> Floats:
    """Share (n,) of each node in a force of 1 on a round patch of the surface."""
    outer = problem.body.outer
    share = outer.spread((hill(outer.places, centre, radius) * outer.areas)[..., None])[:, 0]
    return share / share.sum()
