"""Which fits can be computed with."""

import numpy as np
import pytest

from warpbrain.errors import InputError
from warpbrain.gp.sampling import METAMODELS, Fit, fit, unstable
from warpbrain.physics.laws.stability import UnstableLawError, require_stable


def fitted(name: str, *values: float) -> Fit:
    return Fit(METAMODELS[name], values, 0.0, 101, True, "")


@pytest.mark.parametrize(
    "fit_",
    [
        fitted("neo-hookean", 1e-3),
        fitted("mooney-rivlin", 0.1, 1e5),
        fitted("mooney-rivlin", 1e5, 0.1),
        fitted("ogden", 100.0, 1.1),
        fitted("ogden", 10.0, 50.0),
        fitted("ogden", -100.0, -2.1),
        fitted("ogden", -10.0, -50.0),
    ],
    ids=lambda one: str(one.values),
)
@pytest.mark.parametrize("formulation", ["coupled", "uncoupled"])
def test_stable_fits(fit_: Fit, formulation: str) -> None:
    assert unstable(fit_, 0.45, formulation) == ""


@pytest.mark.parametrize("alpha", [0.1, 0.5, 1.0])
def test_the_small_exponents_of_the_boxes_are_unstable(alpha: float) -> None:
    """The paper searches them: both its settings start there."""
    assert "supplement Table 2" in unstable(fitted("ogden", 1000.0, alpha))


def test_a_curve_that_ends_there() -> None:
    l = np.linspace(0.6, 1.4, 101)
    y = np.log(METAMODELS["ogden"].energy(l, (1000.0, 0.05)) + 1e-3)
    found = fit(METAMODELS["ogden"], l, y)
    assert found.at_bound == ("alpha",)
    assert unstable(found).startswith("Ogden(mu=")


def test_values_that_are_no_law() -> None:
    assert unstable(fitted("mooney-rivlin", 1.0, -2.0)).startswith("mooney-rivlin: C1 = 1 Pa")


def test_what_fails_in_space_alone() -> None:
    one = fitted("ogden", -400.0, -4.7)
    assert unstable(one, 0.45) == ""
    assert "along (l, 1, 1)" in unstable(one, 0.2)
    assert "lam = " in unstable(fitted("mooney-rivlin", 0.1, 300.0), 0.2)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("neo-hookean", (1.0,)),
        ("mooney-rivlin", (0.1, 0.9)),
        ("mooney-rivlin", (0.6, 0.4)),
        ("ogden", (1.0, 0.9)),
        ("ogden", (-1.0, -4.7)),
    ],
)
@pytest.mark.parametrize("poisson", [0.2, 0.45])
def test_stability_has_no_unit(name: str, values: tuple[float, ...], poisson: float) -> None:
    """What is said of a law is said of it in its own numbers, whatever is known of the same one in another unit."""
    moduli = [unit == "Pa" for unit in METAMODELS[name].units]
    said = []
    for scale in (1e-3, 1.0, 1234.5, 1e6):
        scaled = fitted(name, *np.where(moduli, scale, 1.0) * values)
        expected = ""
        try:
            require_stable(scaled.law(), poisson)
        except UnstableLawError as error:
            expected = str(error)
        said.append(unstable(scaled, poisson))
        assert said[-1] == expected
    assert len(set(map(bool, said))) == 1


def test_bad_arguments_are_not_an_unstable_law() -> None:
    with pytest.raises(InputError, match=r"poisson = 0\.5"):
        unstable(fitted("neo-hookean", 1.0), 0.5)
