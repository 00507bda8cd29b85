"""The tables of docs/verification.md: made of rows, and naming only tests that are there."""

import ast
from pathlib import Path

import pytest
from verification_page import SECTIONS, amount, named_tests, node, page, section
from verification_rows import Measurement

ROOT = Path(__file__).parent.parent
MADE = {"machine": "a computer", "commit": "abc"}


def row(test: str, error: float = 1e-3, bound: float = 2e-3, unit: str = "") -> Measurement:
    return Measurement("volume of a ball", "closed form", error, bound, unit, test)


def functions(file: Path) -> set[str]:
    tree = ast.parse(file.read_text(encoding="utf-8"))
    return {item.name for item in ast.walk(tree) if isinstance(item, ast.FunctionDef)}


def test_the_page_names_no_test_that_is_gone():
    named = named_tests((ROOT / "bench" / "results" / "verification.md").read_text(encoding="utf-8"))
    assert named
    for file, function in named:
        assert function in functions(ROOT / file), f"{file}::{function} is gone: python docs/make_verification.py"


def test_a_page_gives_each_row_with_its_command():
    text = page([row("tests/mesh/test_x.py::test_ball[cpu-3]"), row("tests/mesh/test_x.py::test_ball[cpu-4]")], MADE)
    line = "| volume of a ball | closed form | 0.1 % | 0.2 % | `tests/mesh/test_x.py::test_ball` |"
    assert text.count(line) == 1
    assert "## Meshes and integrals" in text and "## Contact" not in text and "- machine: a computer" in text
    assert named_tests(text) == [("tests/mesh/test_x.py", "test_ball")]


@pytest.mark.parametrize("rows", [[], [row("tests/x.py::test_x", 3e-3)], [row("tests/x.py::test_x", float("nan"))]])
def test_there_is_no_page_without_rows_or_with_one_beyond_its_bound(rows):
    with pytest.raises(ValueError, match=r"no test recorded|allowed 0\.002"):
        page(rows, MADE)


def test_sections_are_found_by_the_longest_path():
    assert section("tests/verification/test_cook.py::test_x") == "Bodies with known solutions"
    assert section("tests/verification/test_febio_te01.py::test_x") == "FEBio's test problems"
    assert section("tests/test_new.py::test_x") == SECTIONS["tests/"]
    assert node("tests/a.py::test_x[a[0]]") == "tests/a.py::test_x"


def test_amounts():
    assert amount(0.0123, "") == "1.2 %" and amount(2e-9, "") == "2e-09" and amount(0.5, "m") == "0.5 m"
    assert amount(1.0, "") == "100 %" and amount(0.0, "orders") == "0 orders"
