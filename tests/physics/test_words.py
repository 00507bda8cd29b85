"""Numbers and directions as people read them, what was found of mechanisms, and what would have been seen."""

import math

import numpy as np
import pytest

from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.sizes import beyond_in_words, size_in_words, smallest_in_words
from warpbrain.physics.words import Smallest, Value, along, length, measured, number, place, seconds, tabled, towards


@pytest.mark.parametrize(
    ("value", "sd", "unit", "said"),
    [
        (137.84, 6.05, "mm", "138 ± 6 mm"),
        (0.10123, 0.0123, "mm", "0.101 ± 0.012 mm"),
        (10670.3, 30.5, "Pa", "10.67 ± 0.03 kPa"),
        (-0.001, 0.2, "%", "0.00 ± 0.20 %"),
        (2.0e-9, 4.0e-10, "m4/(N s)", "2.0e-09 ± 4e-10 m4/(N s)"),
        (3.0, 0.0, "", "3.00"),
        (3.0, math.nan, "s", "3.00 s"),
    ],
)
def test_measured(value, sd, unit, said):
    assert measured(value, sd, unit) == said


def test_number():
    assert [number(v) for v in (0.0, 1234.5, 0.0123, 9.99)] == ["0", "1234", "0.012", "10.0"]
    assert number(math.inf) == "an unknown number"


@pytest.mark.parametrize(
    ("metres", "said"),
    [
        (0.0, "0.00 mm"), (0.0123, "12.30 mm"), (5.2e-4, "0.52 mm"), (9.99e-5, "0.100 mm"), (4.56e-5, "0.046 mm"),
        (9.9e-6, "9.9 µm"), (-3.21e-7, "-0.32 µm"), (2e-10, "0.00020 µm"),
    ],
)  # fmt: skip
def test_a_length_that_is_not_zero_is_not_said_to_be(metres, said):
    assert length(metres) == said


@pytest.mark.parametrize(
    ("time", "said"), [(60.0, "60"), (2.5, "2.5"), (0.0123, "0.0123"), (1020.0, "1020"), (86400.0, "86400")]
)
def test_a_time_has_no_exponent(time, said):
    assert seconds(time) == said


def test_a_number_in_a_table_is_not_said_to_be_zero():
    assert [tabled(v) for v in (0.0, 1.4378, -0.0523, 0.01)] == ["0.000", "1.438", "-0.052", "0.010"]
    assert [tabled(v) for v in (0.007342, -4.26e-4, 3.1e-5)] == ["0.00734", "-0.000426", "3.10e-05"]


@pytest.mark.parametrize(
    ("extent", "said"), [(0.17, "(1, -22, 0) mm"), (0.02, "(1, -22, 0) mm"), (4e-3, "(1.2, -21.9, 0.0) mm")]
)
def test_a_place_is_as_fine_as_the_body_is_small(extent, said):
    assert place((0.00123, -0.02194, -1e-6), extent) == said


@pytest.mark.parametrize(
    ("kind", "smallest", "said"),
    [
        ("gravity", Smallest(0.0077, "", "share"), "from 0.77 % of its full size"),
        ("pressure", Smallest(327.0, "Pa", "value"), "from 327 Pa"),
        ("traction", Smallest(2338.0, "Pa", "value_x"), "from 2.3 kPa"),
        ("swelling", Smallest(4.2, "%", "amount"), "from 4.2 %"),
        ("inclusion", Smallest(1.6, "", "ratio"), "from 2.6 times the stiffness around it"),
        ("viscoelasticity", Smallest(0.41, "", "moduli"), "from a tissue that at first is 1.4 times as stiff"),
        ("contact", Smallest(0.65, "of being there", "share"), "would have been seen"),
        ("contact", Smallest(1.2, "of being there", "share"), "would not have been seen"),
        ("inclusion", Smallest(5137.0, "", "ratio", plausible=False), "would not have been seen, whatever its size"),
        ("swelling", Smallest(14.8, "%", "amount"), "from 15 %"),
        ("gravity", Smallest(3.1, "", "share"), "would not have been seen, whatever its size"),
        ("drainage", Smallest(math.inf, "", ""), "would not have been seen, whatever its size"),
    ],
)
def test_smallest(kind, smallest, said):
    assert smallest_in_words(kind, smallest).startswith(said)


@pytest.mark.parametrize(
    ("kind", "value", "said"),
    [
        ("compressibility", Value("poisson", -0.88, 3.3, ""), "poisson would not be 0.35 to 0.4999"),
        ("compressibility", Value("poisson", 0.4467, 0.002, ""), ""),
        ("swelling", Value("amount", -132.0, 8.0, "%"), "amount would not be -90 to 400 %"),
        ("swelling", Value("amount", 24.8, 3.4, "%"), ""),
        ("fibres", Value("stiffness", -1.0, 3.0, "Pa"), "stiffness would not be above 0 Pa"),
        ("traction", Value("value_x", -3e4, 1.0, "Pa"), ""),
        ("end friction", Value("share", 7.0, 1.0, ""), ""),
    ],
)
def test_a_number_that_cannot_be_is_said(kind, value, said):
    assert beyond_in_words(kind, value) == said


def test_a_direction_is_the_nearest_of_axes_and_halves_between_two():
    ends = {"left": 0, "right": 0, "posterior": 1, "anterior": 1, "inferior": 2, "superior": 2}
    signs = dict.fromkeys(("left", "posterior", "inferior"), -1.0) | dict.fromkeys(
        ("right", "anterior", "superior"), 1.0
    )
    known = {name: signs[name] * np.eye(3)[axis] for name, axis in ends.items()}
    known |= {
        f"{one} and {other}": (known[one] + known[other]) / math.sqrt(2.0)
        for one in ends
        for other in ends
        if ends[one] != ends[other]
    }
    for vector in np.random.default_rng(2).normal(size=(200, 3)):
        cosines = {name: float(direction @ vector) for name, direction in known.items()}
        best = max(cosines.values())
        # of two axes the one that it points to more comes first
        alike = [name for name, cosine in cosines.items() if cosine > best - 1e-12]
        first = max(alike, key=lambda name: float(known[name.split(" and ")[0]] @ vector))
        assert towards(vector) == f"towards {first}"
        back = towards(-vector).removeprefix("towards ")
        assert along(vector) == f"from {back} to {first}"
    assert towards((0.0, 0.0, 0.0)) == along((0.0, 0.0, 0.0)) == ""


DOWN = (0.0, 0.0, -1.0)


@pytest.mark.parametrize(
    ("kind", "values", "axis", "said"),
    [
        ("pressure", [("value", -480.0, 20.0, "Pa")], None, ["480 ± 20 Pa lower", "pulls the wall out of the tissue"]),
        ("pressure", [("value", 480.0, 20.0, "Pa")], None, ["480 ± 20 Pa higher", "pushes the wall into the tissue"]),
        (
            "pressure",
            [("value", -10.0, 20.0, "Pa")],
            None,
            ["-10 ± 20 Pa above that elsewhere, which these"],
        ),
        (
            "traction",
            [("value_x", -900.0, 50.0, "Pa"), ("value_z", -500.0, 9.0, "Pa"), ("value_size", 1030.0, 50.0, "Pa")],
            None,
            ["it acts with 1.03 ± 0.05 kPa towards left and inferior"],
        ),
        (
            "traction",
            [("value_y", 9.0, 50.0, "Pa"), ("value_size", 9.0, 50.0, "Pa")],
            None,
            ["direction which these"],
        ),
        (
            "swelling",
            [("amount", 3.1, 0.1, "%"), ("radius", 12.0, 2.0, "mm")],
            None,
            ["swells by 3.10", "radius is 12.0 ± 2.0 mm"],
        ),
        ("swelling", [("amount", -3.1, 0.1, "%")], None, ["shrinks by 3.10 ± 0.10 %"]),
        ("swelling", [("amount", -0.1, 0.3, "%")], None, ["grows by -0.1 ± 0.3 % of its volume, which these data"]),
        ("gravity", [("share", 0.5, 0.05, "")], (0.0, -1.0, 0.0), ["50 ± 5 % of that weight acts, towards posterior"]),
        ("gravity", [("share", -0.5, 0.05, "")], DOWN, ["-50 ± 5 % of that weight acts, towards superior"]),
        (
            "gravity",
            [("direction_x", 0.4, 0.1, ""), ("direction_y", -0.4, 0.1, ""), ("share", 0.57, 0.05, "")],
            None,
            ["57 ± 5 % of that weight acts, towards right and posterior"],
        ),
        (
            "gravity",
            [("direction_y", 0.2, 0.01, "")],
            DOWN,
            ["tilted by 11.3 ± 0.6 degrees towards anterior"],
        ),
        ("residual-stress", [("tension", -200.0, 30.0, "Pa")], None, ["under a compression of 200 ± 30 Pa"]),
        (
            "residual-stress",
            [("tension", 200.0, 30.0, "Pa"), ("direction_x", 0.9, 0.1, "")],
            None,
            ["under a tension of 200 ± 30 Pa from left to right"],
        ),
        (
            "fibres",
            [("stiffness", 260.0, 40.0, "Pa"), ("direction_z", 1.0, 0.1, "")],
            None,
            ["from inferior to superior"],
        ),
        ("asymmetry", [("exponent", 9.0, 3.0, "")], None, ["9 ± 3: it resists tension more, and compression less"]),
        ("inclusion", [("ratio", 0.25, 0.025, "")], None, ["4.0 ± 0.4 times as soft"]),
        # no mechanism: the names of its numbers are all that it has
        ("softening", [("part", 0.25, 0.025, "")], None, ["part 0.250 ± 0.025"]),
    ],
)
def test_what_was_found_is_said_with_direction_and_sign(kind, values, axis, said):
    text = "; ".join(size_in_words(kind, [Value(*one) for one in values], axis))
    for part in said:
        assert part in text


def test_which_side_an_exponent_stiffens_is_that_of_the_law():
    """Uniaxial stress at stretches of 0.9 and 1.1 against that of the neo-Hookean law, of one shear modulus."""

    def stresses(exponent):
        l = np.array([0.9, 1.1])
        return 2.0 / exponent * (l ** (exponent - 1.0) - l ** (-0.5 * exponent - 1.0))

    plain = stresses(2.0)
    for exponent in (-20.0, -3.0, 1.0, 3.0, 20.0):
        [said] = size_in_words("asymmetry", [Value("exponent", exponent, 0.1, "")])
        presses, pulls = np.abs(stresses(exponent)) - np.abs(plain)
        assert ("resists compression more, and tension less" in said) == (presses > 0.0 and pulls < 0.0)
        assert ("resists tension more, and compression less" in said) == (presses < 0.0 and pulls > 0.0)


def test_every_mechanism_says_something_of_every_number():
    for kind, mechanism in mechanisms().items():
        for name, spec in mechanism.parameters().items():
            if spec.kind in ("number", "numbers") and not spec.method:
                text = smallest_in_words(kind, Smallest(1e-3, spec.unit, name))
                assert text.startswith(("from ", "would"))
                assert "_" not in text
