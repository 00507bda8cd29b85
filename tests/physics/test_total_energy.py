"""The whole energy in NumPy."""

import numpy as np
import pytest
from material_point import MATERIALS, energy_at, random_rotations

from warpbrain.errors import InputError
from warpbrain.physics.laws import FORMULATIONS, MooneyRivlin, NeoHookean, Ogden
from warpbrain.physics.laws.stability import total_energy

STRETCHES = np.random.default_rng(5).uniform(0.7, 1.4, size=(40, 3))


@pytest.mark.parametrize("name", MATERIALS)
def test_it_is_the_energy_of_the_device(name: str, device: str) -> None:
    """At any change of volume and in any axes."""
    material, count = MATERIALS[name], len(STRETCHES)
    F = random_rotations(count, 1) * STRETCHES[:, None, :] @ random_rotations(count, 2)
    found = total_energy(material.law, STRETCHES, material.poisson, material.formulation)
    np.testing.assert_allclose(found, energy_at(material, F, device), rtol=1e-9)


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("law", [NeoHookean(900.0), MooneyRivlin(300.0, 150.0), Ogden((-36.0,), (-50.0,))], ids=str)
def test_small_strains_have_the_moduli_that_were_asked_for(law, formulation: str) -> None:
    """`Psi = mu0 sum e_i^2 + lam/2 (sum e_i)^2` to second order."""
    e, nu = 1e-4 * np.array([[1.0, 0.0, 0.0], [1.0, 1.0, 1.0], [2.0, -1.0, 0.5]]), 0.4
    lame = 2.0 * law.shear_modulus * nu / (1.0 - 2.0 * nu)
    expected = law.shear_modulus * (e**2).sum(axis=1) + 0.5 * lame * e.sum(axis=1) ** 2
    found = 0.5 * (total_energy(law, np.exp(e), nu, formulation) + total_energy(law, np.exp(-e), nu, formulation))
    np.testing.assert_allclose(found, expected, rtol=1e-4)


def test_any_shape_of_stretches() -> None:
    law = MooneyRivlin(1.0, 2.0)
    one = total_energy(law, STRETCHES, 0.3, "uncoupled")
    assert np.array_equal(total_energy(law, STRETCHES.reshape(5, 8, 3), 0.3, "uncoupled"), one.reshape(5, 8))


def test_bad_arguments() -> None:
    with pytest.raises(InputError, match=r"poisson = 0\.5"):
        total_energy(NeoHookean(1.0), STRETCHES, 0.5, "coupled")
    with pytest.raises(InputError, match="formulation = 'mixed'"):
        total_energy(NeoHookean(1.0), STRETCHES, 0.4, "mixed")
