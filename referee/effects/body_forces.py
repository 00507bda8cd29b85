"""Forces and pressures that no mechanism of the tool describes: uniform, swirling, between places, in stripes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from referee.body import Body
from referee.effects.effect import Effect, Floats, Place, hill, unit
from referee.effects.forces import BodyForce, adding
from referee.problem import Problem


@dataclass(frozen=True, kw_only=True)
class UniformForce(BodyForce):
    """A body force of `size` [N/m3] in one direction, far from that of gravity."""

    kind: ClassVar[str] = "uniform-force"
    unit: ClassVar[str] = "N/m3"
    limits: ClassVar[tuple[float, float]] = (10.0, 9000.0)

    direction: Place

    def density(self, body: Body) -> Floats:
        return np.broadcast_to(self.size * unit(np.asarray(self.direction)), body.region[1].shape)


@dataclass(frozen=True, kw_only=True)
class Swirl(BodyForce):
    """A body force that runs around an axis, ``size exp(-r^2/(2 L^2)) (axis x r) / L`` [N/m3].

    Parameters
    ----------
    centre, axis : (x, y, z)
    length : float
        `L` [m].
    """

    kind: ClassVar[str] = "swirl"
    unit: ClassVar[str] = "N/m3"
    limits: ClassVar[tuple[float, float]] = (20.0, 40000.0)

    centre: Place
    axis: Place
    length: float

    def density(self, body: Body) -> Floats:
        r = (body.region[1] - np.asarray(self.centre)) / self.length
        decay = self.size * np.exp(-0.5 * (r**2).sum(axis=-1))
        return decay[..., None] * np.cross(unit(np.asarray(self.axis)), r)


@dataclass(frozen=True, kw_only=True)
class Attraction(BodyForce):
    """Two places in the depth draw each other with `size` [N].

    Parameters
    ----------
    centre, other : (x, y, z)
    radius : float
        Of the hill of body force about each [m].
    """

    kind: ClassVar[str] = "attraction"
    unit: ClassVar[str] = "N"
    limits: ClassVar[tuple[float, float]] = (0.005, 4.0)

    centre: Place
    other: Place
    radius: float

    def density(self, body: Body) -> Floats:
        volumes, places = body.region
        along = unit(np.subtract(self.other, self.centre))
        hills = [hill(places, place, self.radius) for place in (self.centre, self.other)]
        here, there = (weight / (weight * volumes).sum() for weight in hills)
        return self.size * (here - there)[..., None] * along


@dataclass(frozen=True, kw_only=True)
class Stripes(Effect):
    """A pressure on the outer surface in stripes, ``size cos(2 pi x . direction / wavelength + phase)`` [Pa].

    Parameters
    ----------
    direction : (x, y, z)
        Across the stripes.
    wavelength : float
        [m]
    phase : float
    """

    kind: ClassVar[str] = "stripes"
    unit: ClassVar[str] = "Pa"
    limits: ClassVar[tuple[float, float]] = (5.0, 4000.0)
    forces: ClassVar[bool] = True

    direction: Place
    wavelength: float
    phase: float

    def act(self, problem: Problem) -> Problem:
        body = problem.body
        faces = body.faces(body.mesh.node_sets["surface"])
        along = faces.places @ unit(np.asarray(self.direction))
        value = self.size * np.cos(2.0 * np.pi * along / self.wavelength + self.phase)
        return adding(problem, lambda u: -faces.spread(value[..., None] * faces.vectors(body.points + u)))
