"""The file of beliefs: every entry says its unit, its source and its date, and is SI when it is read."""

import datetime
import math
import tomllib
from importlib.resources import files

import pytest

from warpbrain.inference.beliefs import UNITS, belief, beliefs

TABLES = tomllib.loads((files("warpbrain.inference") / "priors.toml").read_text(encoding="utf-8"))


@pytest.mark.parametrize("table", TABLES)
def test_entries_are_whole(table):
    for name, entry in TABLES[table].items():
        assert set(entry) == {"value", "unit", "source", "date"} and entry["unit"] in UNITS, name
        assert len(entry["source"]) > 10 and isinstance(entry["date"], datetime.date), name
        assert all(math.isfinite(value) for value in beliefs(f"{table}.{name}").tolist()), name


def test_units_are_si():
    assert belief("causes.mechanism") == 0.05
    assert belief("registration.turn") == pytest.approx(math.radians(1.0))


def test_lengths_of_a_brain():
    """What is relative to the radius of a body, in millimetres of the brain that it was known of."""
    radius = (0.75 * 1150e-6 / math.pi) ** (1.0 / 3.0)
    for key, length in (
        ("noise.reach", 18.0),
        ("registration.shift", 1.0),
        ("registration.wrong_shift", 10.0),
        ("tissue.field_reach", 26.0),
        ("mesh.alike", 20.0),
        ("mesh.surface_off", 1.5),
        ("mesh.surface_alike", 25.0),
    ):
        assert 1e3 * radius * belief(key) == pytest.approx(length, rel=2e-3)


def test_what_is_not_there_is_an_error():
    with pytest.raises(KeyError):
        belief("noise.colour")
