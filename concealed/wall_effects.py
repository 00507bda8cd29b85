"""Effects on walls: pressure on the cavity or in the ventricles, and a traction on a patch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from concealed.body import Body, Floats, Ints
from concealed.effect import Effect, bell
from warpbrain.mesh import face_vectors, node_areas


def pressure_forces(points: Floats, faces: Ints, pressure: float) -> Floats:
    """Nodal forces [N], shape (n, 3), of a pressure [Pa] that pushes against the outward side of faces (f, 3).

    Exact for linear triangles: each corner carries a third of ``-pressure * area vector``.
    """
    forces = np.zeros_like(points)
    np.add.at(forces, faces.ravel(), np.repeat(-pressure / 3.0 * face_vectors(points, faces), 3, axis=0))
    return forces


@dataclass(frozen=True, kw_only=True)
class CavityPressure(Effect):
    """Pressure in the cavity: above zero it pushes on the tissue, below it draws the wall in. Follows the wall."""

    kind: ClassVar[str] = "cavity pressure"
    unit: ClassVar[str] = "Pa"
    limit: ClassVar[float] = 2500.0
    follows: ClassVar[bool] = True

    def forces(self, body: Body, points: Floats) -> Floats:
        return pressure_forces(points, body.cavity, self.strength)


@dataclass(frozen=True, kw_only=True)
class VentricularPressure(Effect):
    """Pressure in the ventricles over that outside the brain. Follows the wall."""

    kind: ClassVar[str] = "ventricular pressure"
    unit: ClassVar[str] = "Pa"
    limit: ClassVar[float] = 300.0
    follows: ClassVar[bool] = True

    def forces(self, body: Body, points: Floats) -> Floats:
        return pressure_forces(points, body.ventricle, self.strength)


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
        rest = body.mesh.points
        faces = body.cavity if self.wall == "cavity" else body.cortex
        share = node_areas(rest, faces) * bell(rest, self.centre, self.radius)
        return self.strength * share[:, None] * np.asarray(self.direction)
