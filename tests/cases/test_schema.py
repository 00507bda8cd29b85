"""The JSON Schema of `case.toml` says yes and no where the reader does."""

import json
import tomllib
from importlib.resources import files

import jsonschema
import pytest
from folders import CASE, RECORDINGS, changed
from wrong_cases import WRONG

from warpbrain.cases.format.schema import case_schema
from warpbrain.cases.shipped import SHIPPED

VALIDATOR = jsonschema.Draft202012Validator(case_schema())
DATA = files("warpbrain.cases") / "data"

#: Faults that only reading the mesh and the files can find, or that are not TOML at all.
NOT_OF_THE_TEXT = {
    "no axis", "zero axis", "negative mu", "zero mu", "prior", "ogden terms", "ramp back", "ramp nan", "tissue missing",
    "tissue unused", "labels", "set", "empty set", "empty fixed", "elements", "both", "twice", "no mesh", "outside",
    "absolute", "null", "a folder", "list", "tissue 02", "low nu",
}  # fmt: skip


def test_it_is_a_schema():
    schema = case_schema()
    assert json.loads(json.dumps(schema)) == schema
    jsonschema.Draft202012Validator.check_schema(schema)


@pytest.mark.parametrize("file", [file for variants in SHIPPED.values() for file in variants.values()])
def test_shipped_cases_are_valid(file):
    assert not list(VALIDATOR.iter_errors(tomllib.loads((DATA / file).read_text(encoding="utf-8"))))


def test_recordings_are_valid():
    assert not list(VALIDATOR.iter_errors(tomllib.loads(CASE + RECORDINGS)))


@pytest.mark.parametrize("name", sorted(set(WRONG) - NOT_OF_THE_TEXT))
def test_what_the_reader_refuses_is_not_valid(name):
    assert not VALIDATOR.is_valid(tomllib.loads(changed(CASE, WRONG[name][0])))
