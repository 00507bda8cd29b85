"""FEBio's test problems of one hexahedron in a homogeneous state, which six tetrahedra have as well.

Inputs and golden values (solution norm: of the displacements that are solved for) are those of FEBio's test suite: mi04
stretches a neo-Hookean cube to twice its length; in ma20, ma22 and ma24 a cube (E = 1, nu = 0.3) contracts by itself,
with a second Piola-Kirchhoff stress of 0.5 in all directions, in y and z, and in x. FEBio's neo-Hookean law is our
coupled one; its active contraction is our residual stress, and agrees in all twelve digits.
"""

import numpy as np
import pytest
from bodies import model_of
from shapes import cube

from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.mechanisms.residual_stress import ResidualStress
from warpbrain.simulation.equilibrium import EquilibriumOptions, solve_equilibrium
from warpbrain.simulation.model import Material
from warpbrain.simulation.system import System

X, Y, Z = np.eye(3)
OPTIONS = EquilibriumOptions(tolerance=1e-12)


def soft(poisson: float) -> Material:
    """Young's modulus of 1."""
    return Material(NeoHookean(0.5 / (1.0 + poisson)), poisson)


@pytest.mark.parametrize("elements", ["tet4", "tet4-averaged"])
@pytest.mark.parametrize(
    ("name", "directions", "golden"),
    [("ma20", (X, Y, Z), 0.493408719039), ("ma22", (Y, Z), 0.713932797063), ("ma24", (X,), 0.61766348475)],
)
def test_contraction(name: str, directions: tuple, golden: float, elements: str, device: str) -> None:
    mesh = cube(1)
    acting = [ResidualStress(tension=0.5, direction=tuple(a)) for a in directions]
    model = model_of(mesh, soft(0.3), constrained=mesh.points == 0.0, mechanisms=acting, elements=elements)
    found = solve_equilibrium(System(model, device), OPTIONS)
    assert np.linalg.norm(found.u) == pytest.approx(golden, rel=1e-11)


@pytest.mark.parametrize("elements", ["tet4", "tet4-averaged"])
def test_stretch(elements: str, device: str) -> None:
    """mi04; the norm is that of the sides, since the ends are prescribed. Off by 3e-8, FEBio's own convergence."""
    mesh = cube(1)
    constrained = mesh.points == 0.0
    end = mesh.points[:, 0] == 1.0
    constrained[end, 0] = True
    prescribed = np.where(constrained & end[:, None], [1.0, 0.0, 0.0], 0.0)
    model = model_of(mesh, soft(0.45), constrained=constrained, prescribed=prescribed, elements=elements)
    found = solve_equilibrium(System(model, device), OPTIONS)
    assert np.linalg.norm(found.u[~constrained]) == pytest.approx(0.775172839024, rel=1e-7)
