"""Traction on a patch of the surface: a retractor, an instrument, a dressing.

    f_a = t int N_a w(|X - c| / R) dA,    w(r) = 1/2 (1 + cos(pi r)) for r < 1, else 0

on the reference surface; `t` keeps its direction (a dead load).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from warpbrain.mesh import TetMesh, boundary_faces, face_vectors
from warpbrain.physics.expectation import Uniform
from warpbrain.physics.load import Load
from warpbrain.physics.mechanism import Mechanism, ParameterError, parameter

#: Points of a rule of degree 4 on a triangle (Dunavant 1985): barycentric coordinates and weights.
_A, _B = 0.445948490915965, 0.091576213509771
_RULE = [
    *((weights, 0.223381589678011) for weights in ((1 - 2 * _A, _A, _A), (_A, 1 - 2 * _A, _A), (_A, _A, 1 - 2 * _A))),
    *((weights, 0.109951743655322) for weights in ((1 - 2 * _B, _B, _B), (_B, 1 - 2 * _B, _B), (_B, _B, 1 - 2 * _B))),
]


@dataclass(frozen=True, kw_only=True)
class Traction(Load, Mechanism):
    """A traction around a point of the surface.

    Parameters
    ----------
    centre : (float, float, float)
        Point [m].
    value : (float, float, float)
        Traction at the centre [Pa].
    radius : float
        Where it has fallen to zero [m].
    """

    centre: tuple[float, float, float] = parameter("Point of the surface around which it acts.", kind="position")
    value: tuple[float, float, float] = parameter(
        "Traction at the centre.",
        kind="vector",
        unit="Pa",
        typical="0 to 10 kPa (75 mmHg) under retractors; damage from 2.7 to 4 kPa",
        source="120 recordings in 23 patients (diagnosis design, M3)",
    )
    radius: float = parameter(
        "Distance at which it has fallen to zero.",
        default=0.010,
        unit="mm",
        si=1e-3,
        above=0.0,
        expectation=Uniform(5.0, 15.0),
    )
    kind: ClassVar[str] = "traction"
    sentence: ClassVar[str] = "Something presses or pulls on a patch of the surface, such as a retractor."
    example: ClassVar[str] = "traction:centre=58/-17/50,value=-500/0/-500,radius=15"
    confused_with: ClassVar[tuple[str, ...]] = ("contact", "pressure")
    several: ClassVar[bool] = True

    def check(self, mesh: TetMesh) -> None:
        super().check(mesh)
        if not self.nodal_forces(mesh).any() and any(self.value):
            raise ParameterError("centre", "no face of the surface lies within the radius of this point")

    def nodal_forces(self, mesh: TetMesh) -> NDArray[np.float64]:
        faces = boundary_faces(mesh.tetrahedra)
        corners = mesh.points[faces]
        areas = np.linalg.norm(face_vectors(mesh.points, faces), axis=1)
        shares = np.zeros(faces.shape)
        for weights, part in _RULE:
            at = np.einsum("a,faj->fj", weights, corners)
            r = np.minimum(np.linalg.norm(at - np.asarray(self.centre), axis=1) / self.radius, 1.0)
            shares += (part * areas * 0.5 * (1.0 + np.cos(np.pi * r)))[:, None] * np.asarray(weights)
        nodal = np.bincount(faces.ravel(), shares.ravel(), minlength=len(mesh.points))
        return nodal[:, None] * np.asarray(self.value)
