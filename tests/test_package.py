"""What is true of the package as a whole: light to start, complete, and honest about what it needs."""

import ast
import re
import subprocess
import sys
import tomllib
from importlib.metadata import packages_distributions
from importlib.resources import files
from pathlib import Path

import pytest

import warpbrain

HEAVY = ("warp", "numpy", "scipy", "meshio", "pyvista", "vtk", "matplotlib")
PACKAGE = Path(str(files("warpbrain")))


@pytest.mark.parametrize(
    "code",
    [
        "import warpbrain",
        "import warpbrain.cli",
        "from warpbrain.cli import main; main(['--help'])",
        "from warpbrain.cli import main; main(['run', '--help'])",
        "from warpbrain.cli import main; main(['--version'])",
        "import sys, runpy; sys.argv = ['bench', '--help']; runpy.run_module('warpbrain.bench', run_name='__main__')",
    ],
)
def test_nothing_heavy_is_imported_before_there_is_work(code):
    code = f"""
import sys
try:
    {code}
except SystemExit as end:
    assert end.code == 0, end.code
print("HEAVY", *[name for name in {HEAVY} if name in sys.modules])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.splitlines()[-1] == "HEAVY"


def test_version_from_the_command_line():
    done = subprocess.run(
        [sys.executable, "-m", "warpbrain", "--version"], capture_output=True, text=True, timeout=60, check=True
    )
    assert done.stdout == f"warpbrain {warpbrain.__version__}\n"
    assert done.stderr == ""


def test_help_names_every_command_and_option():
    def text(*arguments):
        command = [sys.executable, "-m", "warpbrain", *arguments, "--help"]
        return subprocess.run(command, capture_output=True, text=True, timeout=60, check=True).stdout

    assert "run" in text() and "cases" in text()
    said = text("run")
    for option in ("case", "tissue", "model", "mu", "device", "precision", "steps", "to-rest", "out", "quiet"):
        assert f"--{option}" in said


def test_data_ships_with_the_package():
    from warpbrain.cases.shipped import SHIPPED

    data = PACKAGE / "cases" / "data"
    assert (data / "MNI-NOTICE.txt").is_file()
    for tissues in SHIPPED.values():
        for file in tissues.values():
            assert (data / file).is_file()


def test_what_is_imported_is_declared():
    """Every package that the code imports is a dependency, and not one that another happens to bring."""
    imported = set()
    for file in PACKAGE.rglob("*.py"):
        if "building" in file.parts:  # needs warpbrain[build], and says so
            continue
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                imported |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
                imported.add(node.module.split(".")[0])
    project = (Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8")
    extras = tomllib.loads(project)["project"]["optional-dependencies"]
    # imported where a user asks for what they do
    for module, extra in (
        ("dask", "dask"),
        ("distributed", "dask"),
        ("pyarrow", "parquet"),
        ("argcomplete", "completion"),
    ):
        assert module in [_plain(re.split(r"[^\w.-]", line)[0]) for line in extras[extra]]
        imported.remove(module)
    for cuda in ("12", "13"):
        assert [line.split(">")[0] for line in extras[f"cuda{cuda}"]] == [f"cupy-cuda{cuda}x[ctk]"]
    imported -= {"cupy", "cupyx"}
    images = {_plain(re.split(r"[^\w.-]", line)[0]) for line in extras["images"]}
    assert images == {"nibabel", "simpleitk"}
    imported -= {"nibabel", "SimpleITK"}
    foreign = imported - set(sys.stdlib_module_names) - {"warpbrain"}
    dependencies = tomllib.loads(project)["project"]["dependencies"]
    declared = {_plain(re.split(r"[^\w.-]", line)[0]) for line in dependencies}
    owners = packages_distributions()
    for module in sorted(foreign):
        assert declared & set(map(_plain, owners[module])), f"{module} is imported but not declared"


def _plain(name: str) -> str:
    """A distribution's name as all its spellings have it."""
    return name.lower().replace("-", "_")
