"""The house: every floor imports only from floors below it, and what is particular to a mechanism is in its file."""

import ast
from collections.abc import Iterable, Iterator, Mapping
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from warpbrain.physics.mechanisms import mechanisms

PACKAGE = Path(str(files("warpbrain")))
#: From the ground up; docs/house.md says what each is for.
FLOORS = [
    *(
        "kernels",
        "mesh",
        "physics",
        "recordings",
        "images",
        "gp",
        "cases",
        "simulation",
        "ensemble",
        "inference",
        "estimation",
    ),
    *("worlds", "diagnosis", "report", "terminal", "bench", "cli"),
]
#: Modules that any floor may use, and that use none; the package's public names are everyone's.
LEAVES = ["arrays", "errors", "atomic", "frame", "keys", "plugins", "problems", "seconds", "shown", "threads"]
#: Where a kind of mechanism, or a class of one, may stand outside `physics/mechanisms`, and why.
NAMED = {
    "cases/boundary.py": "[[boundary]] kinds of case.toml",
    "cases/case.py": "a case's anatomy is what its resection leaves",
    "cases/building/node_sets.py": "name of a node set of a shipped mesh",
    "cases/building/tissue_names.py": "name of labels of tissue that is taken out",
    "cases/building/pipeline.py": "names of sets of a shipped mesh",
    "report/summary.py": "name of a set of a shipped mesh, in words",
    "report/views.py": "name of a set of a shipped mesh",
    "report/files.py": "name of a field of the states that `run` writes",
}


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
            assert room(name) in (*LEAVES, ""), f"{leaf} imports {name}"


def test_there_is_no_other_room():
    rooms = {path.name for path in PACKAGE.iterdir() if path.is_dir() and path.name != "__pycache__"}
    assert rooms == set(FLOORS)
    assert {path.stem for path in PACKAGE.glob("*.py")} == {*LEAVES, "__init__", "__main__"}


def run_time_nodes(tree: ast.AST) -> Iterator[ast.AST]:
    """Nodes of a module, those inside functions too; not what is imported for the checker of types alone."""
    yield tree
    for child in ast.iter_child_nodes(tree):
        if not (isinstance(child, ast.If) and ast.unparse(child.test).endswith("TYPE_CHECKING")):
            yield from run_time_nodes(child)


def uses(source: str, modules: Iterable[str]) -> set[str]:
    """Which of some modules a source imports, anywhere; of a package its `__init__` only where a name is of that."""
    imported = set()
    for node in run_time_nodes(ast.parse(source)):
        if isinstance(node, ast.Import):
            imported |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = {f"{node.module}.{alias.name}": node.module for alias in node.names}
            imported |= {name if name in modules else module for name, module in names.items()}
    return imported & set(modules)


def circles(sources: Mapping[str, str]) -> list[list[str]]:
    """Groups of modules each of which imports itself by way of the others, by their sources."""
    names = sorted(sources)
    pairs = [(names.index(name), names.index(other)) for name in names for other in uses(sources[name], sources)]
    graph = coo_array((np.ones(len(pairs)), np.array(pairs).reshape(-1, 2).T), shape=(len(names), len(names)))
    group = connected_components(graph, connection="strong")[1]
    groups = [[names[k] for k in np.flatnonzero(group == number)] for number in range(group.max() + 1)]
    return [members for members in groups if len(members) > 1]


def test_no_module_imports_itself_by_way_of_others():
    """Within a floor, too, and inside functions."""
    sources = {
        ".".join(("warpbrain", *file.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__init__"): (
            file.read_text(encoding="utf-8")
        )
        for file in PACKAGE.rglob("*.py")
    }
    assert circles(sources) == []


def test_a_circle_is_seen_wherever_its_imports_stand():
    late = "def f():\n    from p.a import g\n"
    assert circles({"p": "", "p.a": "from p import b", "p.b": late, "p.c": "import p.a"}) == [["p.a", "p.b"]]
    typed = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from p.a import g\n"
    assert circles({"p": "", "p.a": "from p.b import h", "p.b": typed}) == []


def mentions(tree: ast.AST) -> Iterator[str]:
    """Kinds of mechanisms, their classes, and parameters of theirs that are asked for by name."""
    known = mechanisms()
    modules = {known[kind].__module__ for kind in known}
    asked = {name for mechanism in known.values() for name in mechanism.parameters()}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value in (*known, *modules):
            yield node.value
        elif isinstance(node, ast.ImportFrom) and node.module in modules:
            yield node.module
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ("getattr", "hasattr"):
            name = node.args[1]
            if isinstance(name, ast.Constant) and name.value in asked:
                yield f"{node.func.id} {name.value}"


def test_no_kind_of_mechanism_is_named_outside_its_file():
    own = PACKAGE / "physics" / "mechanisms"
    found = {
        file.relative_to(PACKAGE).as_posix(): list(mentions(ast.parse(file.read_text(encoding="utf-8"))))
        for file in PACKAGE.rglob("*.py")
        if own not in file.parents
    }
    # a reason that is none any more goes
    assert {name: said for name, said in found.items() if said and name not in NAMED} == {}
    assert {name for name in NAMED if not found.get(name)} == set()
