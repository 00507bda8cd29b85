"""One truth on one mesh: what its walls do at a strength and a level."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from concealed.body import Body, Floats
from concealed.draw import Drawn
from concealed.effect import Effect
from concealed.observing import Nodes, rms
from concealed.settling import NEARLY_STILL, STILL, Settler


class Trial:
    """A draw on the fine mesh, observed as it will be.

    Parameters
    ----------
    drawn : Drawn
    body : Body
    nodes : (ventricles, cavity)
        Nodes observed on each wall.
    """

    def __init__(self, drawn: Drawn, body: Body, nodes: tuple[Nodes, Nodes]) -> None:
        self.drawn = drawn
        self.body = body
        self.nodes = nodes
        self._settler = Settler(body, drawn.tissue)
        points = body.mesh.points
        self._middle = 0.5 * (points.min(axis=0) + points.max(axis=0))

    def effects(self, strength: float) -> tuple[Effect, ...]:
        """Every effect, the main one first and at a strength [its unit] with the sign it was drawn with."""
        main = self.drawn.main
        return replace(main, strength=math.copysign(strength, main.strength)), *self.drawn.others

    def exact(self, strength: float, level: float, still: float = STILL) -> tuple[Floats, Floats]:
        """Displacement [m] of the observed points of both walls as it was, before anything of observation."""
        u = self._settler.settle(self.effects(strength), level, still)
        return u[self.nodes[0]], u[self.nodes[1]]

    def observed(self, strength: float, level: float, still: float = STILL) -> tuple[Floats, Floats]:
        """Displacement [m] of the observed points of both walls as it is seen."""
        exact = np.concatenate(self.exact(strength, level, still))
        points = self.body.mesh.points[np.concatenate(self.nodes)]
        seen = self.drawn.blur.seen(points, exact, self._middle)
        return seen[: len(self.nodes[0])], seen[len(self.nodes[0]) :]

    def motion(self, strength: float, level: float) -> tuple[float, float]:
        """Root mean square motion [m] of both walls as it is seen, close enough to look for strengths."""
        ventricles, cavity = self.observed(strength, level, NEARLY_STILL)
        return rms(ventricles), rms(cavity)


class CoarseTrial(Trial):
    """The same on a coarse mesh, for a first guess: every node of the walls, and noise as it is on average."""

    def __init__(self, drawn: Drawn, body: Body) -> None:
        held = body.mesh.node_sets["fixed"]
        ventricles, cavity = (np.unique(faces).astype(np.int64) for faces in (body.ventricle, body.cavity))
        super().__init__(drawn, body, (ventricles, cavity[~held[cavity]]))

    def motion(self, strength: float, level: float) -> tuple[float, float]:
        blur = self.drawn.blur
        walls = zip(self.nodes, self.exact(strength, level, NEARLY_STILL), strict=True)
        seen = (rms(blur.misaligned(self.body.mesh.points[nodes], u, self._middle)) for nodes, u in walls)
        ventricles, cavity = (math.hypot(motion, math.sqrt(blur.mean_square)) for motion in seen)
        return ventricles, cavity
