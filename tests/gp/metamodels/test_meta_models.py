"""Meta-models: their energies, derivatives, boxes and laws."""

import mpmath as mp
import numpy as np
import pytest

from warpbrain.errors import InputError
from warpbrain.gp.literature.forms import FORMS
from warpbrain.gp.sampling import FARTHEST, METAMODELS
from warpbrain.physics.laws import LAWS

#: Values of each meta-model, both signs and the ends of the boxes among them.
VALUES = [
    ("neo-hookean", (1e-3,)),
    ("neo-hookean", (600.0,)),
    ("mooney-rivlin", (300.0, 0.1)),
    ("mooney-rivlin", (0.1, 1e6)),
    ("ogden", (1000.0, 0.1)),
    ("ogden", (400.0, 5.0)),
    ("ogden", (3.0, 50.0)),
    ("ogden", (-900.0, -2.1)),
    ("ogden", (-33.0, -31.57)),
    ("ogden", (-0.1, -50.0)),
]
STRETCHES = np.array([0.3, 0.6, 0.9, 0.99, 1.0 - 1e-5, 1.0 - 1e-9, 1.0, 1.0 + 1e-9, 1.0 + 1e-5, 1.01, 1.1, 1.4, 3.0])

every_value = pytest.mark.parametrize(("name", "values"), VALUES)


def exact_energy(name: str, l: float, values: tuple[float, ...]) -> mp.mpf:
    """The supplement's eq. (2), letter by letter, with 60 digits."""
    l, (a, b) = mp.mpf(l), (mp.mpf(values[0]), mp.mpf(values[-1]))
    if name == "neo-hookean":
        return a / 2 * (l**2 + 2 / l - 3)
    if name == "mooney-rivlin":
        return a * (l**2 + 2 / l - 3) + b * (2 * l + l**-2 - 3)
    return a / b * (l**b + 2 * l ** (-b / 2) - 3)


def test_they_are_the_laws() -> None:
    assert set(METAMODELS) == set(LAWS)
    for name, model in METAMODELS.items():
        assert model.name == name
        assert len(model.parameter_names) == len(model.units)
        assert set(model.units) <= {"Pa", ""}


@every_value
def test_energies_have_all_digits(name: str, values: tuple[float, ...]) -> None:
    with mp.workdps(60):
        expected = np.array([float(exact_energy(name, l, values)) for l in STRETCHES])
    np.testing.assert_allclose(METAMODELS[name].energy(STRETCHES, values), expected, rtol=1e-13)


@every_value
def test_derivatives_are_those_of_the_energy(name: str, values: tuple[float, ...]) -> None:
    """Against differences with 60 digits."""
    expected = np.zeros((len(STRETCHES), len(values)))
    with mp.workdps(60):
        for i, l in enumerate(STRETCHES):
            for j in range(len(values)):

                def energy(value: mp.mpf, l: float = l, j: int = j) -> mp.mpf:
                    return exact_energy(name, l, (*values[:j], value, *values[j + 1 :]))

                expected[i, j] = float(mp.diff(energy, values[j]))
    found = METAMODELS[name].jacobian(STRETCHES, values)
    assert found.shape == expected.shape
    np.testing.assert_allclose(found, expected, rtol=1e-12)


@every_value
def test_the_law_has_the_energy_and_the_shear_modulus(name: str, values: tuple[float, ...]) -> None:
    model = METAMODELS[name]
    law = model.law(values)
    assert law.name == name
    l = np.array([0.5, 0.8, 1.3, 2.0])
    path = np.stack([l, l**-0.5, l**-0.5], axis=-1)
    np.testing.assert_allclose(model.energy(l, values), law.energy(path), rtol=1e-12)
    # the curvature at rest is three times the modulus
    e = 1e-4 * np.array([-1.0, 1.0])
    around = model.energy(np.exp(e), values).mean()
    assert around == pytest.approx(1.5 * law.shear_modulus * 1e-8, rel=1e-4)


@every_value
def test_the_published_form_of_the_name_has_the_energy(name: str, values: tuple[float, ...]) -> None:
    model = METAMODELS[name]
    l = np.array([0.6, 0.9, 1.2, 1.5])
    several = name == "ogden"
    keys = {key: [v] if several else v for key, v in zip(model.parameter_names, values, strict=True)}
    np.testing.assert_allclose(model.energy(l, values), FORMS[name].energy(l, **keys), rtol=1e-10)


@pytest.mark.parametrize("limit", [5.0, FARTHEST])
@pytest.mark.parametrize("name", METAMODELS)
def test_boxes(name: str, limit: float) -> None:
    for box in METAMODELS[name].boxes(limit):
        lower, upper, start = np.array([box.lower, box.upper, box.start])
        assert np.all((lower <= start) & (start <= upper))
        # no parameter changes sign in a box, and every start is a law
        assert np.all((lower > 0.0) | (upper < 0.0))
        assert METAMODELS[name].law(box.start).shear_modulus > 0.0


def test_boxes_of_ogden_are_those_of_the_paper() -> None:
    """Exponents from 0.1 and -2.1 to a limit, and not between."""
    for limit in (5.0, FARTHEST):
        boxes = METAMODELS["ogden"].boxes(limit)
        assert {(box.lower, box.upper) for box in boxes} == {
            ((0.1, 0.1), (np.inf, limit)),
            ((-np.inf, -limit), (-0.1, -2.1)),
        }
        assert {box.start for box in boxes} >= {(1000.0, 0.1), (-1000.0, -2.1)}


@pytest.mark.parametrize(
    ("name", "values"), [("neo-hookean", (-1.0,)), ("mooney-rivlin", (1.0, -2.0)), ("ogden", (1.0, -2.0))]
)
def test_values_that_are_no_law(name: str, values: tuple[float, ...]) -> None:
    with pytest.raises(InputError, match=rf"{name}: .* must be positive"):
        METAMODELS[name].law(values)
