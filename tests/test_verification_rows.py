"""The table of verification."""

import json

import pytest
from verification_rows import Measurement, Row, Rows, worst


def test_an_error_within_its_bound_becomes_a_row(tmp_path):
    row = Row("tests/x.py::test_x")
    row("volume of a ball", "closed form", 1e-3, 2e-3)
    rows = Rows()
    rows.add(row)
    rows.write(tmp_path / "rows.json")
    assert json.loads((tmp_path / "rows.json").read_text()) == [
        {"claim": "volume of a ball", "reference": "closed form", "error": 1e-3, "bound": 2e-3, "unit": "",
         "test": "tests/x.py::test_x"}
    ]  # fmt: skip


@pytest.mark.parametrize("error", [3e-3, float("nan")])
def test_an_error_beyond_its_bound_fails(error):
    with pytest.raises(AssertionError, match="volume of a ball"):
        Row("x")("volume of a ball", "closed form", error, 2e-3)


def test_of_several_the_one_nearest_its_bound_is_shown():
    near, far = (Measurement("a", "b", error, 1.0, "", "t") for error in (0.5, 0.1))
    assert worst([far, near]) == [near]
