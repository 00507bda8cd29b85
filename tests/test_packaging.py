"""What is packaged elsewhere says the same as pyproject.toml."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def parts(requirement: str) -> tuple[str, str]:
    """Name and bounds of a requirement."""
    name, bounds = re.fullmatch(r"([\w.-]+)\s*(.*)", requirement).groups()
    return name.removesuffix("-base"), bounds.replace(" ", "")


def test_the_conda_recipe_needs_the_same():
    yaml = pytest.importorskip("yaml")
    recipe = yaml.safe_load((ROOT / "packaging" / "conda" / "recipe.yaml").read_text(encoding="utf-8"))
    needed = dict(map(parts, recipe["requirements"]["run"]))
    assert needed.pop("python") == PROJECT["requires-python"]
    assert needed == dict(map(parts, PROJECT["dependencies"]))
    assert recipe["about"]["summary"] == PROJECT["description"]


def test_a_release_is_tested_with_every_python_that_is_declared():
    yaml = pytest.importorskip("yaml")
    workflow = yaml.safe_load((ROOT / ".github" / "workflows" / "release.yml").read_text(encoding="utf-8"))
    declared = {line.rpartition(" ")[2] for line in PROJECT["classifiers"] if re.search(r":: 3\.\d+$", line)}
    assert set(workflow["jobs"]["install"]["strategy"]["matrix"]["python"]) == declared
    assert workflow["jobs"]["publish"]["permissions"] == {"id-token": "write"}


def test_the_changelog_has_a_place_for_what_comes():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    heads = re.findall(r"^## (.*)$", text, flags=re.MULTILINE)
    assert heads[0] == "[Unreleased]"
    assert all(re.fullmatch(r"\[\d+\.\d+\.\d+\] - \d{4}-\d{2}-\d{2}", head) for head in heads[1:])
