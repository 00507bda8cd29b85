"""A key of `case.toml`: its type, unit, limits, default and meaning, and how its value is read, written and shown."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.frame import Frame
from warpbrain.problems import CONTROL

#: Characters of a name, which stands in tables and names files.
LONGEST_NAME = 100
#: A limit that is no farther from 0 lets 0 itself pass.
_NEXT_TO = 1e-9
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
            if re.search(CONTROL, value):
                return f"expected {self.expected()} without control characters, found {short(value)}"
            if self.name == "name" and not (value.strip() and value.isprintable() and len(value) <= LONGEST_NAME):
                return f"expected 1 to {LONGEST_NAME} printable characters, found {short(value)}"
        elif isinstance(value, dict):
            keys = {key.name: key for key in self.keys}
            for name, inner in value.items():
                if name not in keys:
                    return f"{name}: unknown key, expected {', '.join(keys)}"
                if fault := keys[name].fault(inner):
                    return f"{name}: {fault}"
            missing = [key.name for key in self.keys if key.needed and key.name not in value]
            return f"{missing[0]}: missing, found {short(value)}" if missing else ""
        elif not isinstance(value, list) and not self.above < value < self.below:
            return f"found {value:g}, expected {self._limits()}"
        return ""

    def _limits(self) -> str:
        if math.isinf(self.below):
            # the least number that is allowed is 0 where the limit is next to it
            least = "of at least 0" if -_NEXT_TO < self.above < 0.0 else f"above {self.above:g}"
            return ("a positive number" if self.above == 0.0 else f"a number {least}") + self._in_unit
        return f"a number in the open interval ({self.above:g}, {self.below:g}){self._in_unit}"

    def in_si(self, value: Any, frame: Frame) -> Any:
        """A value of a file in SI units and RAS axes: a float or a tuple of them; a text as it is."""
        if isinstance(value, str):
            return value
        scaled = self._si_factor(frame) * self._in_other_axes(value, frame)
        return float(scaled) if scaled.ndim == 0 else tuple(scaled.tolist())

    def in_file(self, value: Any, frame: Frame) -> Any:
        """The same back: what a file says."""
        if isinstance(value, str):
            return value
        return (self._in_other_axes(value, frame) / self._si_factor(frame)).tolist()

    def _si_factor(self, frame: Frame) -> float:
        return frame.metres if self.unit == "units" else self.si

    def _in_other_axes(self, value: Any, frame: Frame) -> Floats:
        """Numbers with the signs of the other axes, if they are a vector."""
        is_vector = "vector" in self.kinds and np.ndim(value) > 0
        return frame.directions(value) if is_vector else np.asarray(value, dtype=np.float64)


def finite(value: Any) -> bool:
    """Whether it is a number of TOML that a float can hold (its integers may have any number of digits)."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def short(value: Any) -> str:
    """A value as an error message shows it, on one line of a length that can be read."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 80 else f"{text[:77]}..."


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
