"""Every way of writing a form gives the energy that its own formula says."""

import numpy as np
import pytest

from warpbrain.gp.literature.forms import FORMS

L = np.linspace(0.7, 1.3, 13)
I1, I2 = L**2 + 2 / L - 3, 2 * L + L**-2 - 3


def powers(exponent: float) -> np.ndarray:
    return L**exponent + 2 * L ** (-exponent / 2) - 3


def squares(mu, alpha):
    return sum(2 * m / a**2 * powers(a) for m, a in zip(mu, alpha, strict=True))


TERMS = {"mu": (1610.0, 300.0), "alpha": (-16.6, 4.0)}
HALVES = {"C": (-3543.0, -2723.0, 654.0), "m": (1.0, -1.0, 2.0)}
MIHAI = -3543 / 2 * powers(2) + 2723 / 2 * powers(-2) + 654 / 4 * powers(4)
#: Form, convention, what a paper gives, and the energy by its formula.
CASES = [
    ("ogden", "supplement", TERMS, 1610 / -16.6 * powers(-16.6) + 300 / 4 * powers(4.0)),
    ("ogden", "budday", TERMS, squares(**TERMS)),
    ("ogden", "miller", {"mu": (842.0,), "alpha": (-4.7,)}, 2 * 842 / 4.7**2 * powers(-4.7)),
    ("ogden", "abaqus", TERMS, squares(**TERMS)),
    ("ogden", "mihai", HALVES, MIHAI),
    ("mooney-rivlin", "supplement", {"C1": 130.0, "C2": 15.0}, 130 * I1 + 15 * I2),
    ("mooney-rivlin", "budday", {"mu": 290.0, "c": 130.0}, 130 * I1 + 15 * I2),
    ("mooney-rivlin", "mihai", {"C1": 0.28, "C2": 333.0}, 0.14 * I1 + 166.5 * I2),
    ("ogden-mooney", "mihai", {**HALVES, "C1": 280.0, "C2": 333.0}, MIHAI + 140 * I1 + 166.5 * I2),
    ("gent", "mihai", {"C": 333.28, "beta": 0.9918}, -333.28 / (2 * 0.9918) * np.log(1 - 0.9918 * I1)),
    ("gent", "budday", {"mu": 333.28, "eta": 1.2}, -333.28 * 1.2 / 2 * np.log(1 - I1 / 1.2)),
    ("linear", "young", {"E": 2900.0, "nu": 0.45}, 2000 / 3 * (L - L**-0.5) ** 2),
]


@pytest.mark.parametrize(("form", "convention", "given", "expected"), CASES)
def test_energy_is_that_of_the_paper(form, convention, given, expected):
    parameters = FORMS[form].conventions[convention].convert(**given)
    np.testing.assert_allclose(FORMS[form].energy(L, **parameters), expected, rtol=1e-10, atol=1e-10)


def test_small_strain_modulus_of_each_ogden_convention():
    """`mu0 = 1/2 sum mu_p alpha_p` of ours is `sum mu_p` of Budday's and `sum C_p m_p` of Mihai's."""
    convert = {name: c.convert for name, c in FORMS["ogden"].conventions.items()}
    modulus = FORMS["ogden"].shear_modulus
    assert modulus(**convert["budday"](**TERMS)) == pytest.approx(1910.0)
    assert modulus(**convert["mihai"](**HALVES)) == pytest.approx(-3543 + 2723 + 2 * 654)
    assert modulus(**convert["miller"](mu=(842.0,), alpha=(-4.7,))) == pytest.approx(842.0)


def back(convention: str, mu, alpha):
    """From our Ogden parameters to those of a paper."""
    if convention == "mihai":
        return {"C": tuple(mu), "m": tuple(a / 2 for a in alpha)}
    if convention == "supplement":
        return {"mu": tuple(mu), "alpha": tuple(alpha)}
    return {"mu": tuple(m * a / 2 for m, a in zip(mu, alpha, strict=True)), "alpha": tuple(alpha)}


@pytest.mark.parametrize("convention", FORMS["ogden"].conventions)
def test_ogden_goes_there_and_back(convention):
    ours = {"mu": (-3543.0, -2723.0, 654.0), "alpha": (2.0, -2.0, 4.0)}
    again = FORMS["ogden"].conventions[convention].convert(**back(convention, **ours))
    for name, values in ours.items():
        np.testing.assert_allclose(again[name], values, rtol=1e-14)


def test_keys_tell_the_convention_where_they_differ():
    assert FORMS["ogden"].convention_of(["mu", "alpha"]) == "supplement"
    assert FORMS["ogden"].convention_of(["C", "m"]) == "mihai"
    assert FORMS["linear"].convention_of(["mu"]) == "shear"
    assert FORMS["linear"].convention_of(["E"]) == "young"
    assert FORMS["mooney-rivlin"].convention_of(["C1", "C2"]) == "supplement"
    assert FORMS["mooney-rivlin"].convention_of(["mu", "c"]) == "budday"
