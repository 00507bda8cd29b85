"""Prior parameters from `priors.toml`, the only place where they are written."""

import math
import tomllib
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from warpbrain.arrays import Floats

#: Factors to SI of the units that the file uses; what is relative to the size of the body, `R`, is multiplied by
#: `warpbrain.mesh.TetMesh.radius` where it is used.
UNITS = {
    "1": 1.0,
    "R": 1.0,
    "mm": 1e-3,
    "deg": math.radians(1.0),
    "nats": 1.0,
    "kg/m3": 1.0,
    "Pa": 1.0,
    "kPa": 1e3,
    "s": 1.0,
}


@cache
def _file() -> dict[str, dict[str, dict[str, Any]]]:
    return tomllib.loads((files("warpbrain.inference") / "priors.toml").read_text(encoding="utf-8"))


@cache
def _values(key: str) -> tuple[float, ...]:
    table, name = key.split(".")
    entry = _file()[table][name]
    values = entry["value"] if isinstance(entry["value"], list) else [entry["value"]]
    return tuple(float(value) * UNITS[entry["unit"]] for value in values)


def belief(key: str) -> float:
    """One number [SI] by `table.name`; `KeyError` if the file has no such entry."""
    [value] = _values(key)
    return value


def beliefs(key: str) -> Floats:
    """Several numbers [SI], (k,), by `table.name`; raises as `belief`."""
    return np.array(_values(key))
