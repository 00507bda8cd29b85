"""Quadratic tetrahedra: what they must reproduce exactly, and another code on the same mesh."""

import felupe
import numpy as np
import pytest
from bodies import energy_at, forces_at, model_of
from material_point import MATERIALS, random_gradients, random_rotations, stress_at
from shapes import cube, distorted
from verification_rows import Row

from warpbrain.kernels.module import DOUBLE, SINGLE, Precision
from warpbrain.mesh import surface_forces
from warpbrain.physics.laws import NeoHookean
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.model import QUADRATIC, Material
from warpbrain.simulation.system import System

REGULAR = cube(2)
MESH = distorted(REGULAR, 0.08, tissues=2)
#: What tells most of an element; kernels of each of the others take a second to compile.
TWO = ("neo-hookean, coupled", "ogden -20, uncoupled")
SLOW = {name: [] if name in TWO else [pytest.mark.slow(2)] for name in MATERIALS}
every_material = pytest.mark.parametrize(
    "material", [pytest.param(law, id=name, marks=SLOW[name]) for name, law in MATERIALS.items()]
)


@pytest.fixture(params=QUADRATIC)
def elements(request: pytest.FixtureRequest) -> str:
    return request.param


def quadratic(material: Material, elements: str, device: str, precision: str = "double") -> System:
    return System(model_of(MESH, material, material, elements=elements), device, precision)


# -- what is exact ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("material", "precision"),
    [
        *(pytest.param(law, DOUBLE, id=name, marks=SLOW[name]) for name, law in MATERIALS.items()),
        # two laws tell what single precision does to the element, and one most of it
        *(
            pytest.param(MATERIALS[name], SINGLE, id=f"{name}, single", marks=[pytest.mark.slow(2)] if k else [])
            for k, name in enumerate(TWO)
        ),
    ],
)
def test_patch(material: Material, elements: str, precision: Precision, device: str, verify: Row) -> None:
    """A linear displacement: no force inside, and the law's stress everywhere."""
    system = quadratic(material, elements, device, precision.name)
    nodes = system.quadratic
    F = random_gradients(1, 0.2, seed=11)[0]
    u = nodes.points @ (F - np.eye(3)).T
    forces = forces_at(system, u)
    P = stress_at(material, F[None], device)[0]
    # rounding against the stiffness, which is what cancels, and against the stress
    tolerance = 100.0 * precision.epsilon * (material.volumetric_modulus + np.abs(P).max())
    error = 100.0 * np.abs(forces[~nodes.on_surface]).max() / tolerance
    verify(f"patch test, {elements}, every law: forces inside", "none", error, 100.0, "roundings of the stiffness")
    # sum of f (x) X is the volume times the stress
    assert np.abs(forces.T @ nodes.points / MESH.volume - P).max() <= 20.0 * tolerance
    assert np.abs(system.stresses() - P).max() <= tolerance


@every_material
def test_rotation_is_free_of_forces(material: Material, elements: str, device: str) -> None:
    system = quadratic(material, elements, device)
    R = random_rotations(1, seed=12)[0]
    forces = forces_at(system, system.quadratic.points @ (R - np.eye(3)).T + 0.1)
    assert np.abs(forces).max() <= 1e-12 * material.volumetric_modulus


@every_material
def test_forces_and_tangents_are_derivatives(material: Material, elements: str, device: str) -> None:
    system = quadratic(material, elements, device)
    rng = np.random.default_rng(3)
    u, d = 0.02 * rng.uniform(-1.0, 1.0, (system.size, 3)), rng.normal(size=(system.size, 3))
    h = 2e-6
    slope = (energy_at(system, u + h * d) - energy_at(system, u - h * d)) / (2.0 * h)
    assert np.vdot(forces_at(system, u), d) == pytest.approx(slope, rel=1e-6)
    change = (forces_at(system, u + h * d) - forces_at(system, u - h * d)) / (2.0 * h)
    system.u.assign(u)
    system.evaluate_tangents()
    assert np.abs(system.stiffness_times(d) - change).max() <= 1e-6 * np.abs(change).max()


# -- another code -------------------------------------------------------------------------------------------------


def test_felupe(device: str, verify: Row) -> None:
    """Coupled neo-Hookean under a dead force; the same mesh, rule and law. Its points have eight digits."""

    mesh = distorted(cube(3), 0.05)
    z = cube(3).points[:, 2]
    constrained = np.repeat((z < 1e-9)[:, None], 3, axis=1)
    system = System(model_of(mesh, Material(NeoHookean(1.0), 0.45), constrained=constrained, elements="tet10"), device)
    nodes = system.quadratic
    force = surface_forces(nodes, lambda X: np.outer(X[:, 2] > 0.9, [0.04, 0.02, -0.06]))
    found = EquilibriumSolver(system, EquilibriumOptions(tolerance=1e-12)).solve(external=force).u

    # VTK's order: edges 01, 12, 20, 03, 13, 23, and elements that are not inside out
    cells = nodes.elements.copy()
    edges = nodes.points[cells[:, 1:4]] - nodes.points[cells[:, :1]]
    cells = cells[:, [0, 1, 2, 3, 4, 7, 5, 6, 8, 9]]
    turned = np.linalg.det(edges) < 0.0
    cells[turned] = cells[turned][:, [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]]
    theirs = felupe.Mesh(np.array(nodes.points), cells, "tetra10")
    field = felupe.FieldContainer([felupe.Field(felupe.RegionQuadraticTetra(theirs), dim=3)])
    solid = felupe.SolidBody(felupe.NeoHookeCompressible(mu=1.0, lmbda=9.0), field)
    load = felupe.PointLoad(field, np.arange(len(nodes.points)), values=force)
    fixed = felupe.Boundary(field[0], mask=system.model.constrained[:, 0])
    dof0, dof1 = felupe.dof.partition(field, {"fixed": fixed})
    result = felupe.newtonraphson(items=[solid, load], dof0=dof0, dof1=dof1, tol=1e-12, verbose=0)
    expected = result.x[0].values
    assert np.abs(expected).max() > 0.05
    error = np.abs(found - expected).max() / np.abs(expected).max()
    verify("displacement of a distorted cube, coupled neo-Hookean, tet10", "FElupe, the same elements", error, 1e-8)
