"""The house: every floor imports only from floors below it."""

import ast
from importlib.resources import files
from pathlib import Path

import pytest

PACKAGE = Path(str(files("warpbrain")))
#: From the ground up; docs/house.md says what each is for.
FLOORS = [
    *("kernels", "mesh", "physics", "recordings", "gp", "cases", "simulation", "ensemble", "inference", "estimation"),
    *("worlds", "diagnosis", "report", "terminal", "bench", "cli"),
]
#: Modules that any floor may use, and that use none.
LEAVES = ["errors", "atomic", "frame", "problems", "threads", "values"]


def room(module: str) -> str:
    return module.split(".")[1] if module.count(".") else ""


def imports(file: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            assert node.level == 0, f"{file}: relative import"
            found.add(node.module)
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return {name for name in found if name.split(".")[0] in ("warpbrain", "concealed", "referee")}


@pytest.mark.parametrize("floor", FLOORS)
def test_imports_point_down(floor):
    allowed = {*LEAVES, *FLOORS[: FLOORS.index(floor) + 1], ""}
    for file in (PACKAGE / floor).rglob("*.py"):
        for name in imports(file):
            assert name.startswith("warpbrain") and room(name) in allowed, f"{file} imports {name}"


def test_leaves_use_leaves_only():
    for leaf in LEAVES:
        for name in imports(PACKAGE / f"{leaf}.py"):
            assert room(name) in LEAVES, f"{leaf} imports {name}"


def test_there_is_no_other_room():
    rooms = {path.name for path in PACKAGE.iterdir() if path.is_dir() and path.name != "__pycache__"}
    assert rooms == set(FLOORS)
    assert {path.stem for path in PACKAGE.glob("*.py")} == {*LEAVES, "__init__", "__main__"}
