"""Elements in nearly incompressible tissue, on irregular meshes: beside P2-P1 elements, and a manufactured solution."""

from functools import cache

import numpy as np
import pytest
from bodies import model_of
from numpy.typing import NDArray
from scipy.sparse.linalg import splu
from shapes import cube
from taylor_hood import SHEAR_MODULUS, WEIGHT, block, clamped, taylor_hood_work
from verification_rows import Row

from warpbrain.mesh import QuadraticMesh, TetMesh, volume_forces
from warpbrain.mesh.integrals import shape_values
from warpbrain.physics.laws import NeoHookean
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.locking import MEASURED
from warpbrain.simulation.model import ELEMENTS, Material
from warpbrain.simulation.system import System

Floats = NDArray[np.float64]
SCIKIT_FEM = "P2-P1 elements of scikit-fem on the same mesh, linear elasticity"


@cache
def reference(poisson: float) -> float:
    return taylor_hood_work(block(3), poisson)


def error(elements: str, poisson: float, formulation: str, device: str) -> float:
    """Of the work of a block's weight, relative to P2-P1 elements: negative if it is too stiff."""
    mesh = block(3)
    material = Material(NeoHookean(SHEAR_MODULUS), poisson, formulation)
    system = System(model_of(mesh, material, constrained=clamped(mesh.points), elements=elements), device)
    force = volume_forces(system.quadratic or mesh, lambda x: np.tile(WEIGHT, (len(x), 1)))
    u = EquilibriumSolver(system, EquilibriumOptions(max_cg=20_000)).solve(external=force).u
    return float(np.vdot(force, u)) / reference(poisson) - 1.0


@pytest.mark.parametrize(
    ("poisson", "formulation", "bound"),
    [(0.499, "uncoupled", 1e-3), (0.4999, "uncoupled", 1e-4), (0.4999, "coupled", 1e-2)],
)
def test_mixed_ones_do_not_lock(poisson: float, formulation: str, bound: float, device: str, verify: Row) -> None:
    """Three elements through the height; `tet10` is 14 and 20 % too stiff there. Strains are 1e-3 at most.

    The energy without `lam` of the coupled formulation asks for some volume at each point, as 2/3 of the shear modulus.
    """
    claim = f"block of irregular elements tet10-mixed under its weight, nu = {poisson:g}, {formulation}: its work"
    verify(claim, SCIKIT_FEM, abs(error("tet10-mixed", poisson, formulation, device)), bound)


@pytest.mark.parametrize("elements", ELEMENTS)
def test_what_runs_say_of_elements_is_so(elements: str) -> None:
    """The figures of `bench/elements.py` that are printed: at one Poisson ratio, to the digit that is told."""
    assert error(elements, 0.499, "uncoupled", "cpu") == pytest.approx(MEASURED[0.499][elements], abs=2e-3)


# -- order of convergence -----------------------------------------------------------------------------------------

#: Of the manufactured solution: so small that 1/K is below the errors that are looked at.
NEAR = 0.49999


def irregular(n: int) -> TetMesh:
    """The unit cube, its inner nodes moved by up to a fifth of a cell."""
    mesh = cube(n)
    inside = np.all((mesh.points > 1e-9) & (mesh.points < 1.0 - 1e-9), axis=1, keepdims=True)
    moved = np.random.default_rng(0).uniform(-0.2 / n, 0.2 / n, mesh.points.shape) * inside
    return TetMesh(mesh.points + moved, mesh.tetrahedra)


def isochoric(x: Floats) -> Floats:
    """`u = rot (0, 0, sin pi x sin pi y cos pi z)`: no divergence, and `lap u = -3 pi^2 u`."""
    (a, b, c), (s, t, _) = np.cos(np.pi * x).T, np.sin(np.pi * x).T
    return np.pi * np.stack([s * b * c, -a * t * c, np.zeros(len(x))], axis=1)


def pressure_slope(x: Floats) -> Floats:
    """Of `p = sin pi x cos pi y sin pi z`."""
    (a, b, c), (s, t, r) = np.cos(np.pi * x).T, np.sin(np.pi * x).T
    return np.pi * np.stack([a * b * r, -s * t * r, s * b * c], axis=1)


def error_of_displacement(n: int, device: str) -> float:
    """In the middle of tetrahedra, root mean square, relative: linear elasticity with `-mu lap u - grad p` as load."""
    mesh = irregular(n)
    nodes = QuadraticMesh(mesh)
    held = np.repeat(nodes.on_surface, 3)
    system = System(model_of(mesh, Material(NeoHookean(1.0), NEAR, "uncoupled"), elements="tet10-mixed"), device)
    force = volume_forces(nodes, lambda x: 3.0 * np.pi**2 * isochoric(x) - pressure_slope(x)).ravel()
    u = isochoric(nodes.points).ravel()
    K = system.stiffness().tocsc()
    u[~held] = splu(K[~held][:, ~held]).solve(force[~held] - K[~held][:, held] @ u[held])
    values = shape_values(np.full((1, 4), 0.25))[0] @ u.reshape(-1, 3)[nodes.elements]
    exact = isochoric(mesh.points[mesh.tetrahedra].mean(axis=1))
    found = np.linalg.norm(values - exact) / np.linalg.norm(exact)
    return float(found)


def test_displacements_converge_with_the_third_power(device: str, verify: Row) -> None:
    errors = [error_of_displacement(n, device) for n in (3, 6)]
    verify(
        "nearly incompressible displacement of elements tet10-mixed, irregular: order of convergence, less than 3 by",
        "manufactured solution without divergence, with a pressure, linear elasticity",
        3.0 - float(np.log2(errors[0] / errors[1])),
        0.3,
    )
