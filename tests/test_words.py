"""The documentation is no longer than people read: words of all pages, of prose, tables and code."""

import runpy
import shutil
import subprocess
from pathlib import Path

import pytest

COUNT = runpy.run_path(str(Path(__file__).parents[1] / "docs" / "count_words.py"))


def test_pages_are_short_enough():
    total = sum(COUNT["words"](page.read_text(encoding="utf-8")) for page in COUNT["pages"]())
    assert total <= COUNT["MOST"], "python docs/count_words.py says where they are"


@pytest.mark.skipif(shutil.which("wc") is None, reason="wc is not installed")
def test_words_are_those_of_wc(tmp_path):
    page = (
        "# A page\n\nTwo words\nand *three* more.\n\n    indented code\n\n| a | b |\n|---|---|\n\n```sh\nrun it\n```\n"
    )
    (tmp_path / "page.md").write_text(page)
    counted = subprocess.run(["wc", "-w", tmp_path / "page.md"], capture_output=True, text=True, check=True).stdout
    assert COUNT["words"](page) == int(counted.split()[0]) == 20
