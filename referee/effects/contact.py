"""A patch of a support that the case declares as fixed slides along the skull in truth, or lifts off it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from referee.body import Body
from referee.effects.effect import Effect, Floats, Place
from referee.problem import Problem
from warpbrain.recordings.closest import closest_points

#: Stiffness of the skull that stops the tissue, for each area [Pa/m]: a force of 1 N on 1 cm2 enters it by 0.05 mm.
SKULL = 2e8


@dataclass(frozen=True, kw_only=True)
class Contact(Effect):
    """Nodes of a support within `size` [m] of a point are not stuck.

    Parameters
    ----------
    centre : (x, y, z)
    lifts : bool
        Whether they can lift off too, or only slide.
    support : {"side", "fixed"}
        Set of nodes: the patch at the side, or the base of the skull, which is free over a patch only.
    """

    kind: ClassVar[str] = "contact"
    unit: ClassVar[str] = "m"
    limits: ClassVar[tuple[float, float]] = (0.008, 0.07)
    power: ClassVar[float] = 2.0

    centre: Place
    lifts: bool
    support: str = "side"

    def act(self, problem: Problem) -> Problem:
        body = problem.body
        within = np.linalg.norm(body.points - np.asarray(self.centre), axis=1) < self.size
        loose = body.nodes(self.support) & within
        if self.support == "side":
            loose &= ~body.nodes("fixed")
        areas = np.linalg.norm(body.outer.spread(body.outer.vectors(body.points)), axis=1)
        # corners of quadratic triangles have no area of their own, but have neighbours that do
        stiffness = SKULL * np.maximum(areas, areas[loose].mean())[loose] if loose.any() else np.zeros(0)
        skull = Skull(body)
        held = problem.held & ~loose[:, None]

        def springs(u: Floats) -> tuple[Floats, Floats]:
            normals, gap = skull.gap(body.points[loose] + u[loose])
            pressed = gap > 0.0 if self.lifts else np.ones(len(gap), dtype=bool)
            stiff, rest = np.zeros((len(u), 3, 3)), u.copy()
            stiff[loose] = (stiffness * pressed)[:, None, None] * normals[:, :, None] * normals[:, None, :]
            rest[loose] -= gap[:, None] * normals
            return stiff, rest

        return replace(problem, held=held, springs=springs)


class Skull:
    """The surface of a body at rest, along which it slides however far.

    Parameters
    ----------
    body : Body
    """

    def __init__(self, body: Body) -> None:
        self._triangles = body.outer.nodes[:, :3]
        self._points = body.points
        corners = self._points[self._triangles]
        vectors = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals = np.zeros_like(self._points)
        np.add.at(normals, self._triangles, vectors[:, None])
        lengths = np.linalg.norm(normals, axis=1)
        #: At the corners (n, 3), the mean of the faces about each; zero elsewhere.
        self._normals = normals / np.where(lengths > 0.0, lengths, 1.0)[:, None]

    def gap(self, places: Floats) -> tuple[Floats, Floats]:
        """Outward normals (k, 3) at the points of the surface nearest to places (k, 3), and how far out these are."""
        if not len(places):
            return np.zeros((0, 3)), np.zeros(0)
        nearest = closest_points(places, self._points, self._triangles)
        # they change continuously from face to face
        normals = (nearest.weights[:, :, None] * self._normals[self._triangles[nearest.face]]).sum(axis=1)
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        return normals, np.einsum("ki,ki->k", places - nearest.position, normals)
