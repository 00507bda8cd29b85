"""Effects on walls: pressure on the cavity or in the ventricles, and a traction on a patch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from concealed.body import Body, Floats
from concealed.effect import Effect, bell
from concealed.face_loads import pressure_forces, traction_forces


@dataclass(frozen=True, kw_only=True)
class CavityPressure(Effect):
    """Pressure in the cavity: above zero it pushes on the tissue, below it draws the wall in. Follows the wall."""

    kind: ClassVar[str] = "cavity pressure"
    unit: ClassVar[str] = "Pa"
    limit: ClassVar[float] = 2500.0
    follows: ClassVar[bool] = True

    def forces(self, body: Body, points: Floats) -> Floats:
        return pressure_forces(points, body.quadratic.six_nodes(body.cavity), self.strength)


@dataclass(frozen=True, kw_only=True)
class VentricularPressure(Effect):
    """Pressure in the ventricles over that outside the brain. Follows the wall."""

    kind: ClassVar[str] = "ventricular pressure"
    unit: ClassVar[str] = "Pa"
    limit: ClassVar[float] = 300.0
    follows: ClassVar[bool] = True

    def forces(self, body: Body, points: Floats) -> Floats:
        return pressure_forces(points, body.quadratic.six_nodes(body.ventricle), self.strength)


@dataclass(frozen=True, kw_only=True)
class WallTraction(Effect):
    """A traction on a round patch of the cavity's wall or of the cortex, constant in direction.

    Parameters
    ----------
    wall : {"cavity", "cortex"}
    centre : (x, y, z)
        Of the patch [m].
    radius : float
        Where it has fallen to 1/e [m].
    direction : (x, y, z)
        Unit vector of the traction.
    """

    kind: ClassVar[str] = "traction"
    unit: ClassVar[str] = "Pa"
    limit: ClassVar[float] = 6000.0

    wall: str
    centre: tuple[float, float, float]
    radius: float
    direction: tuple[float, float, float]

    def forces(self, body: Body, points: Floats) -> Floats:
        faces = body.quadratic.six_nodes(body.cavity if self.wall == "cavity" else body.cortex)

        def traction(places: Floats) -> Floats:
            return self.strength * bell(places, self.centre, self.radius)[:, None] * np.asarray(self.direction)

        return traction_forces(body.quadratic.points, faces, traction)
