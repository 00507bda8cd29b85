"""The stability conditions of the supplement's Table 2."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from material_point import LAWS, moduli_at

from warpbrain.errors import InputError
from warpbrain.physics.laws import FORMULATIONS, Law, MooneyRivlin, NeoHookean, Ogden
from warpbrain.physics.laws.stability import Path, UnstableLawError, require_stable
from warpbrain.simulation.model import Material

#: Stretches [1] of the uniaxial path, and those at which the volume is half to twice.
FAR, NEAR = np.geomspace(0.1, 10.0, 101), np.geomspace(0.5, 2.0, 41)


def uniaxial_curvature(law: Law, l: np.ndarray) -> np.ndarray:
    """`d2Psi/dl2` of `(l, l^-1/2, l^-1/2)`, differentiated by hand."""
    if isinstance(law, NeoHookean):
        return law.mu * (1.0 + 2.0 * l**-3)
    if isinstance(law, MooneyRivlin):
        return 2.0 * law.C1 * (1.0 + 2.0 * l**-3) + 6.0 * law.C2 * l**-4
    assert isinstance(law, Ogden)
    terms = zip(law.mu, law.alpha, strict=True)
    return sum(m * ((a - 1.0) * l ** (a - 2.0) + (0.5 * a + 1.0) * l ** (-0.5 * a - 2.0)) for m, a in terms)


@pytest.mark.parametrize("law", [*LAWS.values(), NeoHookean(1e-3), MooneyRivlin(1.0, 1e3)], ids=str)
def test_stable_laws_pass(law: Law) -> None:
    require_stable(law)
    assert np.all(uniaxial_curvature(law, FAR) > 0.0)


@pytest.mark.parametrize(
    ("law", "message"),
    [
        # w = C1 (l^2 + 2/l) + C2 (2 l + l^-2): with C2 < 0 the slope turns as l -> 0
        (MooneyRivlin(300.0, -100.0), "compression"),
        # with C1 < 0 it turns in tension
        (MooneyRivlin(-100.0, 300.0), "tension"),
        (Ogden((1000.0, -30.0), (2.0, 8.0)), "tension"),
    ],
)
def test_unstable_laws_are_refused(law: Law, message: str) -> None:
    with pytest.raises(UnstableLawError, match=rf"unstable in {message}: dPsi/dl at l = [\d.]+"):
        require_stable(law)


def test_refusal_is_an_input_error() -> None:
    with pytest.raises(InputError, match=r"MooneyRivlin\(C1=300.0, C2=-100.0\)"):
        require_stable(MooneyRivlin(300.0, -100.0))


def test_a_bounded_slope_is_refused() -> None:
    """`C2` alone: the stress `2 C2 (1 - l^-3)` has a ceiling."""
    with pytest.raises(UnstableLawError, match="the slope does not grow without bound as l -> infinity"):
        require_stable(MooneyRivlin(0.0, 500.0))


def test_a_law_that_softens_is_refused() -> None:
    """Ogden with 0 < alpha < 1: the energy is convex at rest, then bends over in tension."""
    with pytest.raises(UnstableLawError, match="d2Psi/dl2 is not positive"):
        require_stable(Ogden((2000.0 / 0.5,), (0.5,)))


# -- stable and unstable functions, as in the supplement's Fig. 2 -------------------------------------------------


def first_stretch(caught: pytest.ExceptionInfo[UnstableLawError]) -> float:
    """The stretch that a message names."""
    found = re.search(r" l = ([\d.]+)", str(caught.value))
    assert found
    return float(found[1])


def require_first_beyond(caught: pytest.ExceptionInfo[UnstableLawError], turns: float, path: Path) -> None:
    """The stretch named is the first one of the path beyond that where the curvature turns, to its three digits."""
    assert 0.995 * turns <= first_stretch(caught) <= 1.005 * turns * np.exp(path.step)


def ogden(alpha: float, shear_modulus: float = 1000.0) -> Ogden:
    return Ogden((2.0 * shear_modulus / alpha,), (alpha,))


@given(alpha=st.one_of(st.floats(1.05, 50.0), st.floats(-50.0, -2.1)), modulus=st.floats(1e-2, 1e7))
def test_ogden_is_stable_outside_a_band_of_exponents(alpha: float, modulus: float) -> None:
    require_stable(ogden(alpha, modulus))
    assert np.all(uniaxial_curvature(ogden(alpha, modulus), FAR) > 0.0)


@given(alpha=st.one_of(st.floats(-1.95, -0.01), st.floats(0.01, 1.0)))
def test_ogden_is_unstable_in_a_band_of_exponents(alpha: float) -> None:
    """`-2 <= alpha <= 1`, which the paper's search leaves out but for 0.1 to 1: the slope has a ceiling or falls."""
    with pytest.raises(UnstableLawError, match=r"d2Psi/dl2 is not positive|the slope does not grow"):
        require_stable(ogden(alpha))
    # it vanishes or turns at one end: far beyond the path if the exponent is near an end of the band
    assert uniaxial_curvature(ogden(alpha), np.array([1e-9, 1e9])).min() < 1e-2 * uniaxial_curvature(ogden(alpha), 1.0)


@given(C1=st.floats(1e-2, 1e5), C2=st.floats(1e-2, 1e5))
def test_mooney_rivlin_of_positive_coefficients_is_stable(C1: float, C2: float) -> None:
    require_stable(MooneyRivlin(C1, C2))
    assert np.all(uniaxial_curvature(MooneyRivlin(C1, C2), FAR) > 0.0)


def test_a_published_set_that_is_unstable() -> None:
    """Basal ganglia in tension (Budday 2017), C1 and C2 exchanged as in the paper's source: good where it was fitted.

    The curvature `2 C1 (1 + 2 l^-3) + C2 6 l^-4` turns at l = 3.5, the slope farther out.
    """
    C1, C2 = -5.0, 290.0
    l = np.linspace(1.0, 10.0, 100001)
    turns = l[np.argmax(2.0 * C1 * (1.0 + 2.0 * l**-3) + 6.0 * C2 * l**-4 <= 0.0)]
    with pytest.raises(UnstableLawError, match="d2Psi/dl2 is not positive") as caught:
        require_stable(MooneyRivlin(C1, C2))
    require_first_beyond(caught, turns, Path((1.0, -0.5, -0.5), 10.0, 200))
    require_stable(MooneyRivlin(C2, -C1))


# -- in three dimensions ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize(
    "law",
    [*LAWS.values(), MooneyRivlin(500.0, 0.1), *(ogden(a) for a in (1.1, 2.0, 8.0, 50.0, -2.1, -3.0, -10.0, -50.0))],
    ids=str,
)
def test_usual_laws_are_stable_in_space(law: Law, formulation: str) -> None:
    confined = np.stack([NEAR, np.ones_like(NEAR), np.ones_like(NEAR)], axis=1)
    dilated = np.cbrt(NEAR)[:, None, None] * np.eye(3)
    for poisson in (0.3, 0.4, 0.45, 0.49, 0.4999):
        require_stable(law, poisson, formulation)
        material = Material(law, poisson, formulation)
        assert np.all(moduli_at(material, confined[:, :, None] * np.eye(3))[:, 0, 0, 0, 0] > 0.0), poisson
        assert np.all(np.einsum("kiijj->k", moduli_at(material, dilated)) > 0.0), poisson


@pytest.mark.parametrize("alpha", [-2.1, -4.7, -8.0])
def test_softening_in_confined_tension(alpha: float) -> None:
    """What the path does not show: `- sum mu_p ln J` is concave where the coefficients are negative."""
    law = ogden(alpha)
    require_stable(law, 0.45)
    require_stable(law, 0.2, "uncoupled")
    expected = (
        r"coupled, at the Poisson ratio 0.2 is unstable at the stretch l = 1.[89]\d? along \(l, 1, 1\): d2Psi/dl2"
    )
    with pytest.raises(UnstableLawError, match=expected):
        require_stable(law, 0.2)


def test_softening_in_confined_tension_by_the_formula() -> None:
    """The first stretch that is named is where the curvature, written out, turns."""
    alpha, nu = -4.7, 0.2
    mu, lam = 2.0 / alpha, 2.0 * nu / (1.0 - 2.0 * nu)

    def curvature(l: float) -> float:
        return mu * (alpha - 1.0) * l ** (alpha - 2.0) + (mu + lam * (1.0 - np.log(l))) / l**2

    l = np.linspace(1.0, 2.0, 2001)
    turns = l[np.argmax(curvature(l) <= 0.0)]
    with pytest.raises(UnstableLawError) as caught:
        require_stable(ogden(alpha, 1.0), nu)
    require_first_beyond(caught, turns, Path((1.0, 0.0, 0.0), 2.0, 60))


class Soft(MooneyRivlin):
    """A law whose volumetric modulus has the wrong sign: no Poisson ratio in (-1, 1/2) does this to ours."""

    def volumetric_modulus(self, poisson: float, formulation: str) -> float:
        return -1000.0


def test_softening_in_volume() -> None:
    with pytest.raises(UnstableLawError, match=r"unstable in \w+ along \(l, 1, 1\)"):
        require_stable(Soft(300.0, 200.0), 0.45, "uncoupled")


class Stressed(NeoHookean):
    """Energy at rest."""

    def energy(self, stretches: np.ndarray) -> np.ndarray:
        return super().energy(stretches) + 1.0


def test_energy_at_rest() -> None:
    with pytest.raises(UnstableLawError, match="is not at rest at l = 1: energy 1 Pa, slope"):
        require_stable(Stressed(1000.0))


@given(factor=st.floats(1e-3, 1e3))
def test_units_do_not_matter(factor: float) -> None:
    """A law and the same one stiffer fail alike."""
    law = MooneyRivlin(300.0, -100.0)
    other = replace(law, C1=factor * law.C1, C2=factor * law.C2)
    said = []
    for one in (law, other):
        with pytest.raises(UnstableLawError) as caught:
            require_stable(one)
        said.append(str(caught.value).removeprefix(repr(one)))
    assert said[0] == said[1]
