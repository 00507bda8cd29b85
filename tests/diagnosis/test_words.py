"""Numbers as people read them, and what would have been seen."""

import math

import pytest

from warpbrain.diagnosis.words import measured, number, smallest_in_words
from warpbrain.worlds.body.values import Smallest


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
        ("inclusion", Smallest(5137.0, "", "ratio"), "would not have been seen, whatever its size"),
        ("asymmetry", Smallest(15000.0, "", "exponent"), "would not have been seen, whatever its size"),
        ("drainage", Smallest(math.inf, "", ""), "would not have been seen, whatever its size"),
    ],
)
def test_smallest(kind, smallest, said):
    assert smallest_in_words(kind, smallest).startswith(said)
