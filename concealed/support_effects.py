"""Effects on how the brain lies: part of the skull base slips, the head is turned, the fluid's level is misjudged."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from concealed.body import Body, Bools
from concealed.effect import Effect
from warpbrain.mesh import face_vectors
from warpbrain.physics.mechanisms.gravity import Gravity


@dataclass(frozen=True, kw_only=True)
class Slip(Effect):
    """The brain slides on the skull base within a distance of a point; `strength` is that distance.

    Of each node there only the component nearest to the surface's normal stays held.

    Parameters
    ----------
    centre : (x, y, z)
        [m]
    """

    kind: ClassVar[str] = "slip"
    unit: ClassVar[str] = "m"
    limit: ClassVar[float] = 0.07

    centre: tuple[float, float, float]

    def held(self, body: Body, held: Bools) -> Bools:
        points = body.mesh.points
        loose = held.any(axis=1) & (np.linalg.norm(points - np.asarray(self.centre), axis=1) < self.strength)
        normal = np.zeros_like(points)
        np.add.at(normal, body.cortex.ravel(), np.repeat(face_vectors(points, body.cortex), 3, axis=0))
        kept = np.abs(normal).argmax(axis=1)[:, None] == np.arange(3)
        return np.where(loose[:, None], held & kept, held)


@dataclass(frozen=True, kw_only=True)
class TurnedHead(Effect):
    """The head is turned so that the side of the operation is up; `strength` is the angle. It was imaged unturned."""

    kind: ClassVar[str] = "turned head"
    unit: ClassVar[str] = "degrees"
    limit: ClassVar[float] = 45.0

    def gravity(self, body: Body, gravity: Gravity) -> Gravity:
        angle = np.radians(self.strength)
        down = np.cos(angle) * np.asarray(gravity.direction) - np.sin(angle) * body.outwards
        x, y, z = (float(value) for value in down)
        return replace(gravity, direction=(x, y, z), imaged_direction=gravity.direction)


@dataclass(frozen=True, kw_only=True)
class MisjudgedLevel(Effect):
    """The declared level of the fluid is off by `strength`; the true one acts."""

    kind: ClassVar[str] = "misjudged level"
    unit: ClassVar[str] = "m"
    limit: ClassVar[float] = 0.03

    def declared_level(self, level: float) -> float:
        return level + self.strength
