"""What every law has to satisfy at a material point, whatever its formula."""

import numpy as np
import pytest
from material_point import (
    LAWS,
    MATERIALS,
    Point,
    energy_at,
    moduli_at,
    random_gradients,
    random_rotations,
    stress_at,
)

from warpbrain.kernels.module import Precision
from warpbrain.physics.laws import FORMULATIONS, Law, MooneyRivlin, NeoHookean, Ogden
from warpbrain.simulation.model import Material

every_material = pytest.mark.parametrize("material", MATERIALS.values(), ids=MATERIALS.keys())
every_law = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())

#: Moderate strains: with alpha = -20 the energies reach 1e3 times the modulus already.
F = random_gradients(60, 0.2)
Q = random_rotations(60, seed=5)


def relative(difference: np.ndarray, size: np.ndarray) -> float:
    """Largest error of an array of tensors, each against its own norm."""
    axes = tuple(range(1, size.ndim))
    return float(np.max(np.sqrt(np.sum(difference**2, axes) / np.sum(size**2, axes))))


@every_material
def test_turning_the_body_turns_the_stress(material: Material, device: str) -> None:
    # rounding of Q F itself is amplified by the stiffness: 1e-15 times |A||F|/|P| of a few hundred
    assert np.allclose(energy_at(material, Q @ F, device), energy_at(material, F, device), rtol=1e-11)
    P = stress_at(material, F, device)
    assert relative(stress_at(material, Q @ F, device) - Q @ P, P) < 1e-11
    A = moduli_at(material, F, device)
    turned = np.einsum("nia,nkb,najbl->nijkl", Q, Q, A)
    assert relative(moduli_at(material, Q @ F, device) - turned, A) < 1e-12


@every_material
def test_turning_the_material_changes_nothing(material: Material, device: str) -> None:
    """Isotropy: `P(F Q) = P(F) Q`."""
    P = stress_at(material, F, device)
    assert relative(stress_at(material, F @ Q, device) - P @ Q, P) < 1e-11


@every_material
def test_moduli_are_symmetric(material: Material, precision: Precision, device: str) -> None:
    A = Point(material, F, precision, device).moduli()
    assert relative(A - A.transpose(0, 3, 4, 1, 2), A) < 8.0 * precision.epsilon


@every_material
def test_stress_is_the_derivative_of_energy(material: Material, device: str) -> None:
    direction = np.random.default_rng(7).uniform(-1.0, 1.0, F.shape)
    # fourth-order differences at h = 1e-4: error of order (25 h)^4 = 4e-11 for powers of 25, rounding 1e-16 / h
    h = 1e-4

    def along(s: float) -> np.ndarray:
        return energy_at(material, F + s * h * direction, device)

    slope = (along(-2) - 8.0 * along(-1) + 8.0 * along(1) - along(2)) / (12.0 * h)
    P = stress_at(material, F, device)
    size = np.linalg.norm(P, axis=(1, 2)) * np.linalg.norm(direction, axis=(1, 2))
    np.testing.assert_array_less(np.abs(slope - np.sum(P * direction, axis=(1, 2))) / size, 1e-8)


@every_material
def test_moduli_are_the_derivative_of_stress(material: Material, device: str) -> None:
    direction = np.random.default_rng(8).uniform(-1.0, 1.0, F.shape)
    h = 1e-4

    def along(s: float) -> np.ndarray:
        return stress_at(material, F + s * h * direction, device)

    slope = (along(-2) - 8.0 * along(-1) + 8.0 * along(1) - along(2)) / (12.0 * h)
    A = moduli_at(material, F, device)
    assert relative(slope - np.einsum("nijkl,nkl->nij", A, direction), slope) < 1e-8


@every_material
def test_rest_is_free_of_stress_and_linearly_elastic(material: Material, precision: Precision, device: str) -> None:
    """At rest (and rotated) `P = 0` and `dP/dF` is that of linear elasticity with `mu0` and the Poisson ratio."""
    point = Point(material, np.eye(3)[None], precision, device)
    density, P = point.stress()
    mu, nu = material.law.shear_modulus, material.poisson
    lam = 2.0 * mu * nu / (1.0 - 2.0 * nu)
    d = np.eye(3)
    hooke = lam * np.einsum("ij,kl->ijkl", d, d)
    hooke += mu * (np.einsum("ik,jl->ijkl", d, d) + np.einsum("il,jk->ijkl", d, d))
    assert np.abs(P).max() <= 4.0 * precision.epsilon * mu
    assert abs(density[0]) <= 4.0 * precision.epsilon * mu
    np.testing.assert_allclose(point.moduli()[0], hooke, rtol=0.0, atol=16.0 * precision.epsilon * hooke.max())


@pytest.mark.parametrize("poisson", [-0.3, 0.0, 0.3, 0.499])
@pytest.mark.parametrize("formulation", FORMULATIONS)
@every_law
def test_poisson_ratio_at_rest(law: Law, formulation: str, poisson: float, device: str) -> None:
    A = moduli_at(Material(law, poisson, formulation), np.eye(3)[None], device)[0]
    lam, mu = A[0, 0, 1, 1], A[0, 1, 0, 1]
    assert mu == pytest.approx(law.shear_modulus, rel=1e-12)
    # lambda is found next to 2 mu, which costs digits where it is small
    assert lam / (2.0 * (lam + mu)) == pytest.approx(poisson, abs=1e-12)


@every_material
def test_greater_stretch_greater_stress(material: Material, device: str) -> None:
    """Baker-Ericksen: of two principal Cauchy stresses the greater belongs to the greater stretch."""
    l = np.exp(np.random.default_rng(9).uniform(-0.4, 0.4, (300, 3)))
    P = stress_at(material, l[:, :, None] * np.eye(3), device)
    s = np.diagonal(P, axis1=1, axis2=2) * l
    for i, j in ((0, 1), (0, 2), (1, 2)):
        assert np.all((s[:, i] - s[:, j]) * (l[:, i] - l[:, j]) > 0.0)


def assert_same_law(one: Material, other: Material, gradients: np.ndarray, device: str) -> None:
    np.testing.assert_allclose(energy_at(one, gradients, device), energy_at(other, gradients, device), rtol=1e-11)
    P, A = stress_at(other, gradients, device), moduli_at(other, gradients, device)
    assert relative(stress_at(one, gradients, device) - P, P) < 1e-11
    assert relative(moduli_at(one, gradients, device) - A, A) < 1e-12


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_neo_hookean_is_ogden_of_exponent_2(formulation: str, device: str) -> None:
    one = Material(NeoHookean(700.0), 0.4, formulation)
    other = Material(Ogden((700.0,), (2.0,)), 0.4, formulation)
    assert_same_law(one, other, F, device)


def test_mooney_rivlin_is_ogden_of_exponents_2_and_minus_2(device: str) -> None:
    """Only uncoupled: `I2` is the sum of `l^-2` at J = 1 alone, so that the coupled forms differ elsewhere."""
    laws = MooneyRivlin(300.0, 200.0), Ogden((600.0, -400.0), (2.0, -2.0))
    one, other = (Material(law, 0.4, "uncoupled") for law in laws)
    assert_same_law(one, other, F, device)
    one, other = (Material(law, 0.4, "coupled") for law in laws)
    isochoric = F / np.cbrt(np.linalg.det(F))[:, None, None]
    np.testing.assert_allclose(energy_at(one, isochoric, device), energy_at(other, isochoric, device), rtol=1e-11)
    assert not np.allclose(energy_at(one, F, device), energy_at(other, F, device), rtol=1e-3)


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_terms_of_zero_change_nothing(formulation: str, device: str) -> None:
    law = LAWS["ogden -11.92"]
    assert isinstance(law, Ogden)
    longer = Ogden((*law.mu, 0.0, 0.0), (*law.alpha, 2.0, 2.0))
    one, other = Material(law, 0.45, formulation), Material(longer, 0.45, formulation)
    assert np.array_equal(energy_at(one, F, device), energy_at(other, F, device))
    assert np.array_equal(moduli_at(one, F, device), moduli_at(other, F, device))


@every_law
def test_host_energy_is_the_device_energy(law: Law, device: str) -> None:
    """`Law.energy` (incompressible, for plots and stability checks) against the kernels at J = 1."""
    isochoric = F / np.cbrt(np.linalg.det(F))[:, None, None]
    stretches = np.linalg.svd(isochoric, compute_uv=False)
    np.testing.assert_allclose(
        law.energy(stretches), energy_at(Material(law, 0.45, "uncoupled"), isochoric, device), rtol=1e-10
    )
