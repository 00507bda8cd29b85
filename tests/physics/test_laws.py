"""Laws as plain data: what they refuse, how they scale, and their numbers in simple states."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from material_point import energy_at, stress_at
from scipy.optimize import brentq
from verification_rows import Row

from warpbrain.errors import InputError
from warpbrain.physics.laws import FORMULATIONS, LAWS, Law, MooneyRivlin, NeoHookean, Ogden
from warpbrain.simulation.model import Material

NUMBERS = json.loads((Path(__file__).parents[1] / "verification" / "data" / "material_point.json").read_text())
CLOSED = "closed form, nine digits"
#: Shear modulus 1000 Pa each, as in the reference numbers.
THREE: dict[str, Law] = {
    "nh": NeoHookean(1000.0),
    "mr": MooneyRivlin(300.0, 200.0),
    "ogden": Ogden((2.0 * 1000.0 / -4.7,), (-4.7,)),
}
STRETCHES = (0.8, 0.9, 1.1, 1.3)


# -- plain data ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: NeoHookean(0.0), "neo-hookean: mu = 0 Pa: the shear modulus must be positive"),
        (lambda: NeoHookean(-3.0), "mu = -3 Pa"),
        (lambda: NeoHookean(math.nan), "neo-hookean: mu = nan: expected a finite number"),
        (lambda: MooneyRivlin(1.0, -1.0), r"mooney-rivlin: C1 = 1 Pa, C2 = -1 Pa: the shear modulus 2 \(C1 \+ C2\)"),
        (lambda: MooneyRivlin(math.inf, 1.0), "mooney-rivlin: C1, C2 = inf: expected a finite number"),
        (lambda: Ogden((1.0,), (2.0, 3.0)), "ogden: 1 values of mu and 2 of alpha: expected N of each"),
        (lambda: Ogden((), ()), "ogden: 0 values of mu and 0 of alpha"),
        (lambda: Ogden((1.0,), (0.0,)), r"ogden: alpha = \[0.0\]: an exponent of 0 has no energy"),
        (lambda: Ogden((1.0,), (-2.0,)), "the shear modulus 1/2 sum mu_p alpha_p = -1 Pa must be positive"),
        (lambda: Ogden((math.nan,), (2.0,)), "ogden: mu = nan: expected a finite number"),
        (lambda: Ogden((1.0,), (math.inf,)), "ogden: alpha = inf: expected a finite number"),
    ],
)
def test_bad_parameters_are_refused(make, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make()


@pytest.mark.parametrize("poisson", [0.5, 0.6, -1.0, math.nan, math.inf])
def test_bad_poisson_ratio_is_refused(poisson: float) -> None:
    with pytest.raises(InputError, match=r"the Poisson ratio must lie in the open interval \(-1, 0.5\)"):
        Material(NeoHookean(1.0), poisson)


def test_unknown_formulation_is_refused() -> None:
    with pytest.raises(InputError, match="formulation = 'mixed': expected one of coupled, uncoupled"):
        Material(NeoHookean(1.0), 0.45, "mixed")


def test_laws_by_name() -> None:
    assert set(LAWS) == {"neo-hookean", "mooney-rivlin", "ogden"}
    assert all(law.name == name for name, law in LAWS.items())


@pytest.mark.parametrize("law", [*THREE.values(), Ogden((300.0, -150.0, -10.0), (2.0, -4.7, -20.0))])
def test_scaled_to(law: Law) -> None:
    scaled = law.scaled_to(62.5)
    assert type(scaled) is type(law)
    assert scaled.shear_modulus == pytest.approx(62.5, rel=1e-14)
    factor = 62.5 / law.shear_modulus
    stretches = np.array([[1.2, 0.9, 1.0 / 1.08], [0.7, 1.0, 1.0 / 0.7]])
    np.testing.assert_allclose(scaled.energy(stretches), factor * law.energy(stretches), rtol=1e-13)


def test_ogden_from_the_convention_of_abaqus() -> None:
    """`2 mu/alpha^2`: there the shear modulus is the sum of the coefficients."""
    law = Ogden.from_abaqus((500.0, 250.0), (-4.7, 8.0))
    assert law.shear_modulus == pytest.approx(750.0)
    l = np.array([1.3, 1.0 / 1.3, 1.0])
    expected = sum(2.0 * m / a**2 * (np.sum(l**a) - 3.0) for m, a in ((500.0, -4.7), (250.0, 8.0)))
    assert law.energy(l) == pytest.approx(expected, rel=1e-12)


def test_ogden_takes_lists_and_compares_as_data() -> None:
    assert Ogden([1, 2], [3, 4]) == Ogden((1.0, 2.0), (3.0, 4.0))
    assert hash(Ogden([1, 2], [3, 4])) == hash(Ogden((1.0, 2.0), (3.0, 4.0)))


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_volumetric_modulus_of_neo_hookean(formulation: str) -> None:
    E, nu = 2.0 * 1000.0 * 1.45, 0.45
    expected = {"coupled": E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), "uncoupled": E / (3.0 * (1.0 - 2.0 * nu))}
    assert Material(NeoHookean(1000.0), nu, formulation).volumetric_modulus == pytest.approx(expected[formulation])


# -- incompressible states: the pressure drops out of differences of principal stresses ---------------------------


def nominal(law: Law, l: tuple[float, float, float], free: int, device: str) -> np.ndarray:
    """Principal nominal stresses at J = 1 with the pressure such that direction `free` carries none."""
    P = np.diagonal(stress_at(Material(law, 0.45, "uncoupled"), np.diag(l)[None], device)[0])
    return P - P[free] * l[free] / np.array(l)


@pytest.mark.parametrize("stretch", STRETCHES)
@pytest.mark.parametrize("name", THREE)
def test_incompressible_tension(name: str, stretch: float, device: str, verify: Row) -> None:
    """A1. The reference numbers are differences of the energy, good to nine digits."""
    law, L = THREE[name], stretch
    expected = NUMBERS[f"A1 incompressible {name} stretch {L}"]
    side = L**-0.5
    for what, l in (("uniaxial", (L, side, side)), ("equibiaxial", (L, L, L**-2)), ("pure_shear", (L, 1.0, 1.0 / L))):
        error = abs(nominal(law, l, 2, device)[0] / expected[f"T_{what}"] - 1.0)
        verify("stress of uniaxial, equibiaxial and pure shear tests, incompressible, three laws", CLOSED, error, 1e-8)
    assert law.energy(np.array([L, side, side])) == pytest.approx(expected["psi_uniaxial"], rel=1e-11)


@pytest.mark.parametrize("k", [0.2, 0.5])
@pytest.mark.parametrize("name", THREE)
def test_incompressible_simple_shear(name: str, k: float, device: str, verify: Row) -> None:
    """A2, with the universal relation `s11 - s22 = k s12`."""
    F = np.eye(3)
    F[0, 1] = k
    P = stress_at(Material(THREE[name], 0.45, "uncoupled"), F[None], device)[0]
    error = abs(P[0, 1] / NUMBERS[f"A2 simple shear {name} k={k}"]["shear_stress"] - 1.0)
    verify("stress of simple shear, three laws", CLOSED, error, 1e-8)
    s = P @ F.T
    assert np.abs(s - s.T).max() < 1e-12 * np.abs(s).max()
    assert s[0, 0] - s[1, 1] == pytest.approx(k * s[0, 1], rel=1e-11)


# -- compressible states, uncoupled, Poisson ratio 0.45 -----------------------------------------------------------


@pytest.mark.parametrize("stretch", [0.8, 1.2])
@pytest.mark.parametrize("name", THREE)
def test_free_uniaxial(name: str, stretch: float, device: str, verify: Row) -> None:
    """A3: the sides are free."""
    material = Material(THREE[name], 0.45, "uncoupled")

    def P(side: float) -> np.ndarray:
        return stress_at(material, np.diag([stretch, side, side])[None], device)[0]

    expected = NUMBERS[f"A3 traction-free uniaxial {name} nu=0.45 stretch {stretch}"]
    lateral = brentq(lambda side: P(side)[1, 1], 0.6, 1.5, xtol=1e-14)
    error = max(abs(lateral / expected["lateral"] - 1.0), abs(P(lateral)[0, 0] / expected["T"] - 1.0))
    verify("sides and stress of a uniaxial test, nu 0.45, three laws", CLOSED, error, 1e-8)
    F = np.diag([stretch, lateral, lateral])[None]
    assert energy_at(material, F, device)[0] == pytest.approx(expected["psi"], rel=1e-9)


@pytest.mark.parametrize("stretch", [0.8, 1.2])
@pytest.mark.parametrize("name", THREE)
def test_confined_uniaxial(name: str, stretch: float, device: str, verify: Row) -> None:
    """A4: the sides do not move."""
    P = stress_at(Material(THREE[name], 0.45, "uncoupled"), np.diag([stretch, 1.0, 1.0])[None], device)[0]
    expected = NUMBERS[f"A4 confined uniaxial {name} nu=0.45 stretch {stretch}"]
    error = max(abs(P[0, 0] / expected["T"] - 1.0), abs(P[1, 1] / expected["T_lateral"] - 1.0))
    verify("stresses of a confined test, nu 0.45, three laws", CLOSED, error, 1e-8)


# -- near the incompressible limit, where uncoupled is meant to be used -------------------------------------------


@pytest.mark.parametrize("name", THREE)
def test_free_uniaxial_tends_to_incompressible(name: str, device: str, verify: Row) -> None:
    signed = []
    for poisson in (0.49, 0.499, 0.4999):
        material = Material(THREE[name], poisson, "uncoupled")

        def P(side: float, material: Material = material) -> np.ndarray:
            return stress_at(material, np.diag([1.3, side, side])[None], device)[0]

        lateral = brentq(lambda side: P(side)[1, 1], 0.6, 1.5, xtol=1e-14)
        exact = NUMBERS[f"A1 incompressible {name} stretch 1.3"]["T_uniaxial"]
        signed.append(P(lateral)[0, 0] / exact - 1.0)
    errors = np.abs(signed)
    # in proportion to 1 - 2 nu, the next order of which is a hundredth of it at 0.499
    assert errors[1] == pytest.approx(errors[0] / 10.0, rel=0.02)
    limit = abs(10.0 * signed[2] - signed[1]) / 9.0
    verify("stress of a uniaxial test, nu to 1/2, three laws", "closed form, incompressible", limit, 1e-6)
