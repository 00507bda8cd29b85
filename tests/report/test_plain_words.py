"""What is printed for people has no unit of information in it."""

import ast
import re
from importlib.resources import files
from pathlib import Path

import pytest

PACKAGE = Path(str(files("warpbrain")))


def printed(tree: ast.Module) -> list[str]:
    """Texts of a module that are not of its docstrings."""
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef)
    docs = {ast.get_docstring(node, clean=False) for node in ast.walk(tree) if isinstance(node, documented)}
    texts = (node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str))
    return [text for text in texts if text not in docs]


@pytest.mark.parametrize("floor", ["report", "diagnosis", "worlds", "cli", "terminal"])
def test_nothing_printed_says_nats(floor):
    for file in (PACKAGE / floor).rglob("*.py"):
        for text in printed(ast.parse(file.read_text(encoding="utf-8"))):
            # keys of JSON have it as a part of a word
            assert not re.search(r"\bnats\b", text), f"{file}: {text}"
