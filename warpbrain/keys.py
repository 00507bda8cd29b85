"""A key of `case.toml`: its type, unit, limits, default and meaning, and how its value is read and written."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from warpbrain.frame import Frame
from warpbrain.values import finite, short

#: Characters of a name, which stands in tables and names files.
LONGEST_NAME = 100
#: What a value can be, and how a message calls it.
KINDS = {
    "text": "text",
    "file": "the name of a file in this folder",
    "number": "a finite number",
    "vector": "3 finite numbers",
    "numbers": "a list of finite numbers",
    "pairs": "[time, factor] pairs of finite numbers",
    "table": "a table",
}


@dataclass(frozen=True)
class Key:
    """One key."""

    name: str
    kind: str  # what the value can be, of `KINDS`; several are joined by ``|``
    doc: str  # one sentence; its full stop is left out where the default completes it
    unit: str = ""  # of a number: a unit of SI, or ``"units"`` for the length that ``[case] units`` names
    needed: bool = False  # whether a table without it is wrong
    choices: tuple[str, ...] = ()  # the only texts allowed, if not empty
    above: float = -math.inf  # limits of a number, themselves not allowed
    below: float = math.inf
    hint: str = ""  # what to do where it is missing or out of its limits
    keys: tuple[Key, ...] = ()  # of a table
    default: str | float | None = None  # what it is where it is absent
    si: float = 1.0  # how many of its SI unit one of these is

    @property
    def kinds(self) -> list[str]:
        """What the value can be, of `KINDS`."""
        return self.kind.split("|")

    def described(self) -> str:
        """What it is, where it is absent, too, and its unit."""
        absent = "" if self.doc.endswith(".") else f"; {self.default} if absent."
        return self.doc + absent + self._in_unit

    @property
    def _in_unit(self) -> str:
        return f" [{self.unit}]" if self.unit else ""

    def expected(self) -> str:
        """What the value should be, in words."""
        kinds = [KINDS[kind] for kind in self.kinds if not (self.choices and kind == "text")]
        texts = [f"one of {', '.join(self.choices)}"] if self.choices else []
        return " or ".join(kinds + texts) + self._in_unit

    def fault(self, value: Any) -> str:
        """What is wrong with a value, in words; empty if nothing is."""
        kind = _kind_of(value)
        if kind is None or not any(kind == k or (k, kind) in _ALSO for k in self.kinds):
            return f"expected {self.expected()}, found {short(value)}"
        if isinstance(value, str):
            if self.choices and value not in self.choices:
                return f"found '{value}', expected {self.expected()}"
            if "\0" in value:
                return f"expected {self.expected()}, found {short(value)}"
            if self.name == "name" and not (value.strip() and value.isprintable() and len(value) <= LONGEST_NAME):
                return f"expected 1 to {LONGEST_NAME} printable characters, found {short(value)}"
        elif isinstance(value, dict):
            return self._fault_of_table(value)
        elif not isinstance(value, list) and not self.above < value < self.below:
            return f"found {value:g}, expected {self._limits()}"
        return ""

    def _fault_of_table(self, value: dict[str, Any]) -> str:
        keys = {key.name: key for key in self.keys}
        for name, inner in value.items():
            if name not in keys:
                return f"{name}: unknown key, expected {', '.join(keys)}"
            if fault := keys[name].fault(inner):
                return f"{name}: {fault}"
        missing = [key.name for key in self.keys if key.needed and key.name not in value]
        return f"{missing[0]}: missing, found {short(value)}" if missing else ""

    def _limits(self) -> str:
        if math.isinf(self.below):
            return ("a positive number" if self.above == 0.0 else f"a number above {self.above:g}") + self._in_unit
        return f"a number in the open interval ({self.above:g}, {self.below:g}){self._in_unit}"

    def in_si(self, value: Any, frame: Frame) -> Any:
        """A value of a file in SI units and RAS axes: a float or a tuple of them; a text as it is."""
        if isinstance(value, str):
            return value
        if isinstance(value, int | float):
            return (frame.metres if self.unit == "units" else self.si) * float(value)
        if "vector" not in self.kinds:
            return tuple((self.si * np.asarray(value, dtype=float)).tolist())
        vector = frame.lengths(value) if self.unit == "units" else self.si * frame.directions(value)
        return tuple(vector.tolist())

    def in_file(self, value: Any, frame: Frame) -> Any:
        """The same back: what a file says."""
        if isinstance(value, str):
            return value
        if isinstance(value, int | float):
            return float(value) / (frame.metres if self.unit == "units" else self.si)
        if "vector" not in self.kinds:
            return (np.asarray(value, dtype=float) / self.si).tolist()
        vector = frame.file_lengths(value) if self.unit == "units" else frame.directions(value) / self.si
        return vector.tolist()


#: (wanted, found) pairs that fit as well: three numbers are a list of numbers, a file's name is text.
_ALSO = {("file", "text"), ("numbers", "vector"), ("pairs", "empty"), ("numbers", "empty")}


def _kind_of(value: Any) -> str | None:
    """The kind of `KINDS` that a value of TOML is, ``"empty"`` for a list of nothing, None if it is none."""
    if isinstance(value, dict):
        return "table"
    if isinstance(value, str):
        return "text"
    if finite(value):
        return "number"
    if not isinstance(value, list):
        return None
    if not value:
        return "empty"
    if all(finite(item) for item in value):
        return "vector" if len(value) == 3 else "numbers"
    if all(isinstance(item, list) and len(item) == 2 and all(map(finite, item)) for item in value):
        return "pairs"
    return None


@dataclass(frozen=True)
class Table:
    """A table of `case.toml`."""

    name: str
    doc: str  # one sentence
    keys: tuple[Key, ...] = ()  # that it may have whatever it is
    by: Key | None = None  # the key that says which variant it is; its default is the variant where it is absent
    variants: Mapping[str, tuple[Key, ...]] = field(default_factory=dict)  # what each variant may have besides
    several: bool = False  # whether it is a list of tables, ``[[name]]``

    def keys_of(self, variant: str) -> dict[str, Key]:
        """Keys of a variant by name, the common ones included."""
        first = (self.by,) if self.by is not None else ()
        return {key.name: key for key in (*first, *self.keys, *self.variants.get(variant, ()))}

    def all_keys(self) -> list[str]:
        """Names of the keys of any variant."""
        return list(dict.fromkeys(name for variant in (*self.variants, "") for name in self.keys_of(variant)))
