"""The documentation is no longer than people read: words of prose of all pages."""

import runpy
from pathlib import Path

COUNT = runpy.run_path(str(Path(__file__).parents[1] / "docs" / "count_words.py"))


def test_prose_is_short_enough():
    prose = sum(COUNT["words"](page.read_text(encoding="utf-8"))[0] for page in COUNT["pages"]())
    assert prose <= COUNT["MOST"], "python docs/count_words.py says where they are"


def test_what_is_counted():
    page = (
        "# A page\n\nTwo words\nand *three* more.\n\n    indented code\n\n| a | b |\n|---|---|\n\n```sh\nrun it\n```\n"
    )
    assert COUNT["words"](page) == (8, 6, 6)
