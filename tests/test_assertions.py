"""Every test asserts something."""

import ast
from pathlib import Path

TESTS = Path(__file__).parent
#: Calls that fail by themselves.
RAISING = {"raises", "warns", "fail", "verify"}


def called(node: ast.AST) -> set[str]:
    """Names of the functions that are called somewhere in a piece of code."""
    functions = [item.func for item in ast.walk(node) if isinstance(item, ast.Call)]
    return {f.attr if isinstance(f, ast.Attribute) else getattr(f, "id", "") for f in functions}


def asserts(node: ast.AST, helpers: set[str]) -> bool:
    """Whether code holds an assertion, or calls something that does."""
    names = called(node)
    return (
        any(isinstance(item, ast.Assert) for item in ast.walk(node))
        or any(name.startswith("assert") for name in names)
        or bool(names & (RAISING | helpers))
    )


def test_every_test_asserts_something():
    trees = {file: ast.parse(file.read_text(encoding="utf-8")) for file in sorted(TESTS.rglob("*.py"))}
    functions = {
        file: [item for item in ast.walk(tree) if isinstance(item, ast.FunctionDef)] for file, tree in trees.items()
    }
    every = [function for of_file in functions.values() for function in of_file]
    helpers: set[str] = set()
    while more := {f.name for f in every if not f.name.startswith("test") and asserts(f, helpers)} - helpers:
        helpers |= more
    tests = [(file, f) for file, of_file in functions.items() if file.name.startswith("test_") for f in of_file]
    tests = [(file, f) for file, f in tests if f.name.startswith("test")]
    silent = [f"{file.relative_to(TESTS)}::{f.name}" for file, f in tests if not asserts(f, helpers)]
    assert not silent
