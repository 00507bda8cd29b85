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


def test_authors_and_address_are_those_of_the_project():
    """What cannot read pyproject.toml names the same people, and the same repository once it is published."""
    yaml = pytest.importorskip("yaml")
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    paper = yaml.safe_load((ROOT / "paper" / "paper.md").read_text(encoding="utf-8").split("---")[1])
    recipe = yaml.safe_load((ROOT / "packaging" / "conda" / "recipe.yaml").read_text(encoding="utf-8"))
    names = [person["name"] for person in PROJECT["authors"]]
    assert [person["name"] for person in paper["authors"]] == names
    cited = [who.get("name") or f"{who['given-names']} {who['family-names']}" for who in citation["authors"]]
    assert cited == names
    address = PROJECT.get("urls", {}).get("Repository")
    assert citation.get("repository-code") == recipe["about"].get("repository") == address


def test_the_image_of_apptainer_is_that_of_docker():
    docker = (ROOT / "packaging" / "Dockerfile").read_text(encoding="utf-8")
    apptainer = (ROOT / "packaging" / "warpbrain.def").read_text(encoding="utf-8")
    for pattern in (r"^F(?:ROM|rom:) (python:\S+)$", r"install -y --no-install-recommends ([\w ]+\w)"):
        of_docker, of_apptainer = (re.findall(pattern, text, re.MULTILINE) for text in (docker, apptainer))
        assert of_docker == of_apptainer and len(of_docker) == 1


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
