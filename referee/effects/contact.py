"""A patch of a support that the case declares as fixed slides along the skull in truth, or lifts off it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from referee.effects.effect import Effect, Floats, Place
from referee.problem import Problem

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
        vectors = body.outer.vectors(body.points)
        areas = np.linalg.norm(body.outer.spread(vectors), axis=1)
        # the mean of the faces about a node: of their areas a corner gets nothing, and nothing has no direction
        outward = np.zeros_like(body.points)
        np.add.at(outward, body.outer.nodes, vectors.sum(axis=1)[:, None])
        lengths = np.linalg.norm(outward, axis=1)
        normals = outward / np.where(lengths > 0.0, lengths, 1.0)[:, None]
        # corners of quadratic triangles have no area of their own, but have neighbours that do
        stiffness = SKULL * np.where(loose, np.maximum(areas, areas[loose].mean()), 0.0) if loose.any() else areas * 0.0
        stiff = stiffness[:, None, None] * normals[:, :, None] * normals[:, None, :]
        held = problem.held & ~loose[:, None]

        def springs(u: Floats) -> Floats:
            return stiff * ((u * normals).sum(axis=1) > 0.0)[:, None, None]

        return replace(problem, held=held, springs=springs if self.lifts else lambda u: stiff)
