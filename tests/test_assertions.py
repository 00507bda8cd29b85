"""Every test asserts something."""

import ast
from pathlib import Path

TESTS = Path(__file__).parent
#: Calls that fail by themselves.
RAISING = {"raises", "warns", "fail", "verify"}


def called(node: ast.AST) -> set[str]:
    """Names of the functions that are called somewhere in a piece of code, and `assert` where it holds an assertion."""
    items = list(ast.walk(node))
    functions = [item.func for item in items if isinstance(item, ast.Call)]
    names = {f.attr if isinstance(f, ast.Attribute) else getattr(f, "id", "") for f in functions}
    return names | {"assert" for item in items if isinstance(item, ast.Assert)}


def test_every_test_asserts_something():
    calls: list[tuple[str, str, set[str]]] = []
    for file in sorted(TESTS.rglob("*.py")):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        place = str(file.relative_to(TESTS)) if file.name.startswith("test_") else ""
        functions = [item for item in ast.walk(tree) if isinstance(item, ast.FunctionDef)]
        calls += [(place, function.name, called(function)) for function in functions]
    asserting = {
        (place, name) for place, name, names in calls if names & RAISING or any(n.startswith("assert") for n in names)
    }
    helpers = {name for _, name in asserting if not name.startswith("test")}
    # what calls something that asserts does so too
    while more := {n for _, n, names in calls if not n.startswith("test") and names & helpers} - helpers:
        helpers |= more
    silent = [
        f"{place}::{name}"
        for place, name, names in calls
        if place and name.startswith("test") and (place, name) not in asserting and not names & helpers
    ]
    assert not silent
