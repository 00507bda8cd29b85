"""Element forces and tangent blocks: derivatives of the energy, on a random mesh of two tissues."""

import numpy as np
import pytest
from bodies import energy_at, forces_at, model_of, stiffness_at
from material_point import LAWS, MATERIALS, random_rotations
from shapes import box, distorted, tetrahedron

from warpbrain.kernels.module import DOUBLE, PRECISIONS, SINGLE, Precision
from warpbrain.mesh import TetMesh
from warpbrain.simulation.model import Material
from warpbrain.simulation.system import System

every_material = pytest.mark.parametrize("material", MATERIALS.values(), ids=MATERIALS.keys())
#: What tells most of what single precision does to an element; kernels of each of the others take a second to compile.
TWO = (("neo-hookean", "coupled"), ("ogden", "uncoupled"))


def marks_of(material: Material, precision: Precision) -> list[pytest.MarkDecorator]:
    """Slow, where kernels are compiled for it alone."""
    return [] if precision is DOUBLE or (material.law.name, material.formulation) in TWO else [pytest.mark.slow(1)]


in_every_precision = pytest.mark.parametrize(
    ("material", "precision"),
    [
        pytest.param(
            material,
            precision,
            id=f"{name}, {precision.name}",
            marks=marks_of(material, precision),
        )
        for precision in PRECISIONS.values()
        for name, material in MATERIALS.items()
    ],
)


def body(material: Material, precision: Precision, device: str) -> System:
    """Two tissues of one law, the second three times as stiff: one group of elements with parameters of their own."""
    mesh = distorted(box((2, 1, 1)), 0.1, tissues=2)
    stiffer = Material(material.law.scaled_to(3.0 * material.law.shear_modulus), 0.3, material.formulation)
    return System(model_of(mesh, material, stiffer), device, precision.name)


def state(system: System, amount: float = 0.1) -> np.ndarray:
    return amount * np.random.default_rng(4).uniform(-1.0, 1.0, (system.size, 3))


@every_material
def test_forces_are_the_derivative_of_energy(material: Material, device: str) -> None:
    system = body(material, DOUBLE, device)
    u = state(system)
    direction = np.random.default_rng(5).uniform(-1.0, 1.0, u.shape)
    h = 1e-4  # fourth order: truncation (25 h)^4, rounding 1e-16 / h

    def along(s: float) -> float:
        return energy_at(system, u + s * h * direction)

    slope = (along(-2) - 8.0 * along(-1) + 8.0 * along(1) - along(2)) / (12.0 * h)
    forces = forces_at(system, u)
    assert abs(slope - np.vdot(forces, direction)) < 1e-8 * np.linalg.norm(forces) * np.linalg.norm(direction)


@every_material
def test_tangent_is_the_derivative_of_forces(material: Material, device: str) -> None:
    system = body(material, DOUBLE, device)
    u = state(system)
    direction = np.random.default_rng(6).uniform(-1.0, 1.0, u.shape)
    h = 1e-4

    def along(s: float) -> np.ndarray:
        return forces_at(system, u + s * h * direction)

    slope = ((along(-2) - 8.0 * along(-1) + 8.0 * along(1) - along(2)) / (12.0 * h)).ravel()
    product = stiffness_at(system, u) @ direction.ravel()
    assert np.linalg.norm(slope - product) < 1e-8 * np.linalg.norm(product)


@in_every_precision
def test_tangent_is_symmetric_and_blind_to_translations(material: Material, precision: Precision, device: str) -> None:
    system = body(material, precision, device)
    K = stiffness_at(system, state(system))
    # sums of some twenty element blocks
    rounding = 50.0 * precision.epsilon * np.abs(K).max()
    assert np.abs(K - K.T).max() <= rounding
    translations = np.tile(np.eye(3), (system.size, 1))
    assert np.abs(K @ translations).max() <= rounding


@in_every_precision
def test_both_kernels_give_the_same_forces(material: Material, precision: Precision, device: str) -> None:
    """The kernel with tangents and the one without."""
    system = body(material, precision, device)
    forces = forces_at(system, state(system))
    system.evaluate_tangents()
    system.gather_forces()
    difference = system.internal.numpy() - forces
    assert np.abs(difference).max() <= 50.0 * precision.epsilon * np.abs(forces).max()


@in_every_precision
def test_forces_balance(material: Material, precision: Precision, device: str) -> None:
    """No force and no moment comes from inside a body."""
    system = body(material, precision, device)
    u = state(system)
    forces = forces_at(system, u)
    rounding = 50.0 * precision.epsilon * np.abs(forces).max()
    assert np.abs(forces.sum(axis=0)).max() <= rounding
    assert np.abs(np.cross(system.model.mesh.points + u, forces).sum(axis=0)).max() <= 4.0 * rounding


@in_every_precision
def test_rigid_motion_costs_nothing(material: Material, precision: Precision, device: str) -> None:
    system = body(material, precision, device)
    R = random_rotations(1, seed=8)[0]
    X = system.model.mesh.points
    rigid = X @ R.T + [0.3, -0.2, 0.1] - X
    # stresses of rounding: epsilon times the moduli, on faces of unit area
    rounding = 100.0 * precision.epsilon * 3.0 * material.volumetric_modulus
    assert np.abs(forces_at(system, rigid)).max() <= rounding
    assert abs(energy_at(system, rigid)) <= rounding
    # and on top of any state
    u = state(system)
    turned = (X + u) @ R.T - X
    size = np.abs(forces_at(system, u)).max()
    assert np.abs(forces_at(system, turned) - forces_at(system, u) @ R.T).max() <= max(
        rounding, 200.0 * precision.epsilon * size
    )


@pytest.mark.parametrize(
    "material",
    [pytest.param(material, marks=marks_of(material, SINGLE)) for material in MATERIALS.values()],
    ids=MATERIALS.keys(),
)
def test_single_agrees_with_double(material: Material, device: str) -> None:
    double, single = (body(material, p, device) for p in (DOUBLE, SINGLE))
    u = state(double)
    K = stiffness_at(double, u)
    # powers of 20 and a dozen operations an element: 100 roundings
    assert np.abs(stiffness_at(single, u) - K).max() <= 100.0 * SINGLE.epsilon * np.abs(K).max()
    assert energy_at(single, u) == pytest.approx(energy_at(double, u), rel=100.0 * SINGLE.epsilon)


@pytest.mark.parametrize("order", [[0, 1, 2, 3], [3, 1, 0, 2], [2, 3, 0, 1], [1, 0, 3, 2]])
def test_order_of_the_nodes_does_not_matter(order: list[int], device: str) -> None:
    """Elements are stored with ascending nodes, which turns some inside out: nothing may notice."""
    law = LAWS["mooney-rivlin"]
    corner = tetrahedron()
    place = np.argsort(order)
    mesh = TetMesh(corner.points[order], [place[corner.tetrahedra[0]]])
    u = state(System(model_of(corner, Material(law)), device))
    expected = forces_at(System(model_of(corner, Material(law)), device), u)
    found = forces_at(System(model_of(mesh, Material(law)), device), u[order])
    np.testing.assert_allclose(found, expected[order], rtol=1e-12, atol=1e-12 * np.abs(expected).max())


def test_an_inverted_element_shows_in_its_volume_ratio(device: str) -> None:
    mesh = tetrahedron()
    for law in LAWS.values():
        system = System(model_of(mesh, Material(law)), device)
        u = np.zeros((4, 3))
        u[3] = [0.0, 0.0, -1.5]
        system.u.assign(u)
        energy, min_J = system.energy()
        assert min_J == pytest.approx(-0.5)
        assert np.isfinite(energy)
