"""FEBio's test problem ma02 with our law: Ogden's unconstrained one on 8 x 4 x 4 hexahedra, stretched by half.

The elements are FElupe's (trilinear, eight Gauss points, as FEBio's), the law that of our kernels at their quadrature
points: `c/m^2 (sum l^m - 3 - m ln J) + cp/2 (J - 1)^2` with c = 0.658, m = 6.83, cp = 1. The last term is FEBio's own
and written here; the rest is our coupled law with a Poisson ratio of 0.
"""

import numpy as np
import pytest
from material_point import moduli_at, stress_at

from warpbrain.physics.laws import Ogden
from warpbrain.simulation.model import Material

#: Solution norm, of the displacements that are solved for.
GOLDEN = 7.50244860312
OGDEN = Material(Ogden((0.658 / 6.83,), (6.83,)), 0.0)
CP = 1.0


class OurLaw:
    """A material of FElupe's: gradient and hessian of the energy at points (3, 3, q, c)."""

    def __init__(self) -> None:
        self.x = [np.eye(3), np.zeros(0)]

    def gradient(self, x: list) -> list:
        F = x[0]
        points = np.moveaxis(F, (0, 1), (-2, -1))
        P = stress_at(OGDEN, points.reshape(-1, 3, 3)).reshape(points.shape)
        J, inverse = np.linalg.det(points), np.linalg.inv(points)
        P += (CP * (J - 1.0) * J)[..., None, None] * np.swapaxes(inverse, -1, -2)
        return [np.moveaxis(P, (-2, -1), (0, 1)), x[-1]]

    def hessian(self, x: list) -> list:
        F = x[0]
        points = np.moveaxis(F, (0, 1), (-2, -1))
        A = moduli_at(OGDEN, points.reshape(-1, 3, 3)).reshape(*points.shape, 3, 3)
        J, T = np.linalg.det(points), np.swapaxes(np.linalg.inv(points), -1, -2)
        first, second = CP * (2.0 * J - 1.0) * J, CP * (J - 1.0) * J
        A += first[..., None, None, None, None] * np.einsum("...ij,...kl->...ijkl", T, T)
        A -= second[..., None, None, None, None] * np.einsum("...il,...kj->...ijkl", T, T)
        return [np.moveaxis(A, (-4, -3, -2, -1), (0, 1, 2, 3))]


def test_ma02() -> None:
    """Reached: 5e-8; FEBio stops at changes of displacement of 1e-3."""
    felupe = pytest.importorskip("felupe")
    mesh = felupe.Cube(a=(-1.0, -0.5, 0.0), b=(1.0, 0.5, 1.0), n=(9, 5, 5))
    field = felupe.FieldContainer([felupe.Field(felupe.RegionHexahedron(mesh), dim=3)])
    solid = felupe.SolidBody(OurLaw(), field)
    ends = np.abs(np.abs(mesh.points[:, 0]) - 1.0) < 1e-12
    held = np.flatnonzero(np.repeat(ends, 3))
    free = np.flatnonzero(np.repeat(~ends, 3))
    u = np.zeros_like(mesh.points)
    for share in np.linspace(0.1, 1.0, 10):
        u[mesh.points[:, 0] > 1.0 - 1e-12, 0] = share
        felupe.newtonraphson(items=[solid], x0=field, dof0=held, dof1=free, ext0=u.ravel()[held], tol=1e-10, verbose=0)
    found = field[0].values
    assert np.linalg.norm(found.ravel()[free]) == pytest.approx(GOLDEN, rel=1e-7)
