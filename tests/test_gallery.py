"""The gallery and the API page: what they promise without building the site, which .ci/site does."""

import ast
import re
from pathlib import Path

import pytest

import warpbrain as wb

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("plot_*.py"))


def test_there_are_twelve():
    assert [int(path.name[5:7]) for path in EXAMPLES] == list(range(1, 13))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_says_what_it_is_and_shows_a_picture(path):
    text = path.read_text(encoding="utf-8")
    doc = ast.get_docstring(ast.parse(text))
    title, line = doc.splitlines()[:2]
    assert line == "=" * len(title)
    assert re.search(r"plt\.show\(\)|\.plot\(", text)
    # what a user has is what an example uses
    assert "import warpbrain as wb" in text or "there_and_back" in text


def test_the_page_of_the_api_has_every_public_name():
    page = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    named = set(re.findall(r"^\.\. auto\w+:: warpbrain\.(?:ensemble\.run\.)?(\w+)$", page, flags=re.MULTILINE))
    assert named == set(dir(wb)) - {"cases", "laws", "mechanisms"}
