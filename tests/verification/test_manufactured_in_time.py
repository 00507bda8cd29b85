"""Orders in space and time on irregular meshes: tissue that relaxes, and tissue whose fluid flows."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from bodies import model_of
from manufactured import norm, quadrature
from manufactured_problem import (
    ORDERS,
    Floats,
    boundary_held,
    cofactors,
    coupled_neo_hookean,
    displacement,
    displacement_gradient,
    divergence,
    errors_of,
    irregular,
    orders,
    scalars,
)
from numpy.typing import NDArray
from verification_rows import Row

from warpbrain.mesh import TetMesh, surface_forces
from warpbrain.mesh.integrals import volume_forces
from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.load import Load
from warpbrain.physics.mechanisms.drainage import Drainage, DrainageTerm
from warpbrain.physics.mechanisms.viscoelasticity import Viscoelasticity
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.model import Material
from warpbrain.simulation.system import System

OPTIONS = EquilibriumOptions(tolerance=1e-9)
LINEAR = [name for name in ORDERS if name != "tet10"]
RELAXING = "chosen motion; hereditary integral by Gauss-Legendre quadrature, source by complex steps"
FLOWING = "chosen settlement of a column, Biot's equations solved for the pressure by hand"


@dataclass(frozen=True, kw_only=True)
class Given(Load):
    """Forces (n, 3) [N]."""

    forces: Floats

    def nodal_forces(self, mesh: TetMesh) -> Floats:
        return self.forces


def followed(system: System, steps: int, end: float, at: Callable[[float], tuple[Floats, Floats]]) -> Floats:
    """Displacement at the end of even steps, with what `at` says of a time: prescribed displacements and forces."""
    solver = EquilibriumSolver(system, OPTIONS)
    system.forget()
    u = np.zeros(system.model.constrained.shape)
    for k in range(1, steps + 1):
        prescribed, forces = at(end * k / steps)
        prescribed = np.where(system.model.constrained, prescribed, 0.0)
        system.set_model(replace(system.model, loads=(Given(forces=forces),)))
        u = solver.step(u, end / steps, prescribed=prescribed).u
    return u


# -- tissue that relaxes --------------------------------------------------------------------------------------------

MU, POISSON = 1000.0, 0.4
MODULI, TIMES = (1.0, 0.5), (0.5, 2.0)
#: [s]
END = 2.0
ELASTIC = coupled_neo_hookean(MU, POISSON)
#: 6e-7 of the stress are left.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)


def share(t: float) -> float:
    """Of the chosen displacement at a time: it comes, and goes back by a third."""
    return 1.5 * np.sin(1.2 * t) ** 2 / (1.0 + 0.25 * t)


def isochoric(F: NDArray) -> NDArray:
    """Second Piola-Kirchhoff stress `mu J^-2/3 (I - I1/3 C^-1)`."""
    J, T = cofactors(F)
    third = np.einsum("...ij,...ij->...", F, F) / 3.0
    return MU * scalars(J ** (-2.0 / 3.0)) * (np.eye(3) - scalars(third) * (np.swapaxes(T, -1, -2) @ T))


def relaxing(slope: Callable[[NDArray], NDArray], t: float) -> Callable[[NDArray], NDArray]:
    """Stress at a time of points whose displacement gradient is `share` of `slope`.

    `q = beta (S(t) - 1/tau int_0^t exp(-(t - s)/tau) S(s) ds)`: the hereditary integral by parts, from rest.
    """

    def stress(X: NDArray) -> NDArray:
        H = slope(X)
        F = np.eye(3) + share(t) * H
        total = sum(MODULI) * isochoric(F)
        for x, w in zip(NODES, WEIGHTS, strict=True):
            s = 0.5 * t * (1.0 + x)
            fading = sum(m / tau * np.exp(-(t - s) / tau) for m, tau in zip(MODULI, TIMES, strict=True))
            total = total - 0.5 * t * w * fading * isochoric(np.eye(3) + share(s) * H)
        return ELASTIC(F, X) + F @ total

    return stress


@dataclass(frozen=True)
class Motion:
    """Displacement and displacement gradient at points, of which a time has its `share`."""

    move: Callable[[Floats], Floats]
    slope: Callable[[NDArray], NDArray]


@cache
def relaxing_forces(motion: Motion, level: int, t: float) -> Floats:
    """Forces (n, 3) that the motion needs at a time: the same for all linear elements of a mesh."""
    mesh, stress = irregular(level), relaxing(motion.slope, t)

    def body_force(X: Floats) -> Floats:
        # so few at a time as the cache of a processor holds
        return np.concatenate([-divergence(stress, part) for part in np.array_split(X, 1 + len(X) // 4000)])

    inside = volume_forces(mesh, body_force)
    return inside + surface_forces(mesh, lambda X: (X[:, 2] > 1.0 - 1e-9)[:, None] * stress(X)[..., 2])


@cache
def relaxed(motion: Motion, level: int, steps: int, elements: str) -> Floats:
    """Errors (2,) in L2 of displacement and gradient at the end."""
    mesh = irregular(level)
    held = np.repeat(boundary_held(mesh.points)[:, None], 3, axis=1)
    memory = Viscoelasticity(moduli=MODULI, times=TIMES)
    material = Material(NeoHookean(MU), POISSON)
    system = System(model_of(mesh, material, constrained=held, mechanisms=[memory], elements=elements), "cpu")

    def at(t: float) -> tuple[Floats, Floats]:
        return share(t) * motion.move(mesh.points), relaxing_forces(motion, level, t)

    u = followed(system, steps, END, at)
    end = share(END)
    return errors_of(system.model, u, lambda X: end * motion.move(X), lambda X: end * motion.slope(X))


HOMOGENEOUS = np.array([[-0.10, 0.20, 0.0], [0.0, -0.05, 0.15], [0.10, 0.0, 0.25]])
#: Which elements have exactly.
EVEN = Motion(lambda X: X @ HOMOGENEOUS.T, lambda X: HOMOGENEOUS + 0.0 * X[..., None])
WAVY = Motion(displacement, displacement_gradient)


@pytest.mark.parametrize("elements", LINEAR)
def test_order_in_time_of_tissue_that_relaxes(elements: str, verify: Row) -> None:
    """A homogeneous deformation, which elements have exactly: what is left is of the steps."""
    found = [relaxed(EVEN, 0, steps, elements) for steps in (6, 12)]
    claim = f"`viscoelasticity`, {elements}: order 2 in time; off by"
    verify(claim, RELAXING, np.abs(orders(*found) - 2.0).max(), 0.01, "orders")


@pytest.mark.slow(5)
@pytest.mark.parametrize(
    ("elements", "halvings"),
    # a second halving of averaged elements takes minutes of one core
    [
        *(pytest.param(elements, 1, marks=[pytest.mark.slow(7)] if elements == "tet4" else []) for elements in LINEAR),
        pytest.param("tet4", 2, marks=pytest.mark.slow(65)),
    ],
)
def test_orders_in_space_and_time_of_tissue_that_relaxes(elements: str, halvings: int, verify: Row) -> None:
    found = [relaxed(WAVY, level, 4 * 2**level, elements) for level in range(halvings + 1)]
    short = max((ORDERS[elements] - orders(coarse, fine)).max() for coarse, fine in pairwise(found))
    claim = f"`viscoelasticity`, {elements}: orders 2 and 1, steps halved with the elements; short by"
    # plain linear elements lock, which fades as they become smaller: 0.12 by the first halving
    verify(claim, RELAXING, max(short, 0.0), 0.15 if elements == "tet4" else 0.1, "orders")


# -- tissue whose fluid flows ---------------------------------------------------------------------------------------

#: [m4/(N s)], of a skeleton of 1 Pa.
PERMEABILITY = 1.0


def settled(t: float) -> tuple[float, float]:
    """How far a column has settled, and how fast: from rest, up to a quarter of its height and back."""
    return -0.125 * (1.0 - np.cos(4.0 * t)), -0.5 * np.sin(4.0 * t)


def profile(Z: NDArray) -> NDArray:
    return np.sin(1.2 * Z) + 0.2 * Z**2


def profile_slope(Z: NDArray) -> NDArray:
    return 1.2 * np.cos(1.2 * Z) + 0.4 * Z


def profile_above(Z: NDArray) -> NDArray:
    """Integral of the profile from a height to the top."""
    return (np.cos(1.2 * Z) - np.cos(1.2)) / 1.2 + 0.2 / 3.0 * (1.0 - Z**3)


def pressure(Z: NDArray, t: float) -> NDArray:
    """`k/J dp/dZ = du/dt`: what is taken up below a height flows through it, and at the top the pressure is zero."""
    a, rate = settled(t)
    return -rate / PERMEABILITY * (profile_above(Z) + 0.5 * a * (profile(np.array(1.0)) ** 2 - profile(Z) ** 2))


def along(Z: NDArray, t: float) -> NDArray:
    """Stress along the column: of the skeleton, with mu = 1 Pa and nu = 0.2, less the pressure of the fluid."""
    J = 1.0 + settled(t)[0] * profile_slope(Z)
    return J - 1.0 / J + 2.0 / 3.0 * np.log(J) / J - pressure(Z, t)


def flown(level: int, steps: int, elements: str) -> Floats:
    """Errors (2,) in L2 of displacement and pressure at the end."""
    mesh = irregular(level, cells=2)
    x, y, z = mesh.points.T
    constrained = np.stack([(x < 1e-9) | (x > 1.0 - 1e-9), (y < 1e-9) | (y > 1.0 - 1e-9), z < 1e-9], axis=1)
    fluid = Drainage(permeability=PERMEABILITY, drained="top")
    material = Material(NeoHookean(1.0), 0.2)
    system = System(model_of(mesh, material, constrained=constrained, mechanisms=[fluid], elements=elements), "cpu")

    def upwards(values: Floats) -> Floats:
        return np.outer(values, [0.0, 0.0, 1.0])

    def at(t: float) -> tuple[Floats, Floats]:
        inside = volume_forces(mesh, lambda X: upwards(-along(X[:, 2] + 1e-30j, t).imag / 1e-30))
        top = surface_forces(mesh, lambda X: upwards((X[:, 2] > 1.0 - 1e-9) * along(X[:, 2], t)))
        return np.zeros(mesh.points.shape), inside + top

    end = 0.6
    u = followed(system, steps, end, at)
    [term] = [term for term in system.terms if isinstance(term, DrainageTerm)]
    a, _ = settled(end)
    bary, weights = quadrature(4)
    Z = np.einsum("qa,ea->eq", bary, z[mesh.tetrahedra])
    off = np.einsum("qa,ea->eq", bary, term.pressures()[mesh.tetrahedra]) - pressure(Z, end)
    moved = np.einsum("qa,eai->eqi", bary, u[mesh.tetrahedra]) - upwards(a * profile(Z.ravel())).reshape(*Z.shape, 3)
    return np.array([norm(mesh, weights, moved), norm(mesh, weights, off)])


@pytest.mark.slow(20)
@pytest.mark.parametrize("elements", LINEAR)
def test_orders_in_space_and_time_of_tissue_whose_fluid_flows(elements: str, verify: Row) -> None:
    """Backward Euler: steps are quartered where elements are halved.

    Orders come to 2 from below (1.6 and 1.8 of plain elements on these three meshes) and from above (averaged ones):
    an order of 0.2 is allowed, and the finer pair of meshes is nearer to 2.
    """
    coarse, medium, fine = (flown(level, 4 * 4**level, elements) for level in range(3))
    before, after = orders(coarse, medium), orders(medium, fine)
    claim = f"`drainage`, {elements}: order 2 of displacement and pressure, steps quartered with the elements; short by"
    verify(claim, FLOWING, max((2.0 - after).max(), 0.0), 0.2, "orders")
    assert np.all(np.abs(after - 2.0) < np.abs(before - 2.0))
