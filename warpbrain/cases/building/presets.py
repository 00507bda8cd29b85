"""Names of the labels that programs write: the tables of `presets.toml`."""

from __future__ import annotations

import tomllib
from importlib.resources import files

from warpbrain.errors import InputError

_SOURCE = "source"


def preset_names() -> tuple[str, ...]:
    """Names of the presets."""
    return tuple(_tables())


def preset(name: str) -> dict[int, str]:
    """What each label of a program is, by number.

    Raises
    ------
    InputError
        If there is no preset of that name.
    """
    tables = _tables()
    if name not in tables:
        raise InputError(f"--preset: found '{name}', expected one of {', '.join(tables)}")
    found: dict[int, str] = {}
    for tissue, labels in tables[name].items():
        if tissue == _SOURCE:
            continue
        for label in labels:
            first, _, last = str(label).partition("-")
            found |= dict.fromkeys(range(int(first), int(last or first) + 1), tissue)
    return found


def _tables() -> dict[str, dict[str, list[int | str]]]:
    text = (files("warpbrain.cases.building") / "presets.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)
