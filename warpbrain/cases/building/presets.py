"""Names of the labels that programs write: the tables of `presets.toml`."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

from warpbrain.errors import InputError

_SOURCE, _UNSURE = "source", "unsure"


def preset_names() -> tuple[str, ...]:
    """Names of the presets."""
    return tuple(_tables())


@dataclass(frozen=True)
class Preset:
    """What the labels of a program are.

    Attributes
    ----------
    names : dict of int to str
        By number.
    unsure : dict of int to str
        What else a number can mean: the user must say it.
    """

    names: dict[int, str]
    unsure: dict[int, str]


def preset(name: str) -> Preset:
    """The labels of a program.

    Raises
    ------
    InputError
        If there is no preset of that name.
    """
    tables = _tables()
    if name not in tables:
        raise InputError(f"--preset: found '{name}', expected one of {', '.join(tables)}")
    names: dict[int, str] = {}
    for tissue, labels in tables[name].items():
        if tissue in (_SOURCE, _UNSURE):
            continue
        for label in labels:
            first, _, last = str(label).partition("-")
            names |= dict.fromkeys(range(int(first), int(last or first) + 1), tissue)
    return Preset(names, {int(label): meaning for label, meaning in tables[name].get(_UNSURE, {}).items()})


def _tables() -> dict[str, dict[str, Any]]:
    text = (files("warpbrain.cases.building") / "presets.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)
