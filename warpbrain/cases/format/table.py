"""Reads one table of `case.toml` against what it may say."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import Any

from warpbrain.cases.format.keys import Table
from warpbrain.problems import Problems
from warpbrain.values import short


class Reading:
    """A table of a file: the values that are right, with every fault noted as a problem.

    Parameters
    ----------
    table : Table
        What it may say.
    values : Any
        What the file has there.
    file : Path
    where : str
        How a message calls it: ``"tissue.1"``, ``"boundary 2"``.
    problems : Problems
        Where faults go.

    Attributes
    ----------
    variant : str or None
        Which of the table's variants it is; None if that cannot be told.
    """

    def __init__(self, table: Table, values: Any, file: Path, where: str, problems: Problems) -> None:
        self.file, self.where, self.problems = file, where, problems
        self._good: dict[str, Any] = {}
        self._named: set[str] = set(values) if isinstance(values, dict) else set()
        self.variant: str | None = None
        if not isinstance(values, dict):
            problems.add(file, f"[{where}]", f"expected a table, found {short(values)}")
            return
        if table.by is None:
            self.variant = ""
        else:
            chosen = values.get(table.by.name, table.default or None)
            if isinstance(chosen, str) and chosen in table.by.choices:
                self.variant = chosen
        keys = table.keys_of(self.variant or "")
        for name, value in values.items():
            if name not in keys:
                self._refuse(table, name, list(keys))
            elif fault := keys[name].fault(value):
                # a unit or axes that look alike are others all the same
                guess = isinstance(value, str) and name not in ("units", "axes")
                near = difflib.get_close_matches(value, keys[name].choices, 1) if guess else []
                self.problem(name, fault, f"did you mean '{near[0]}'?" if near else keys[name].hint)
            else:
                self._good[name] = value
        for name, key in keys.items():
            if key.needed and name not in values:
                self.problem(name, "missing", key.hint or f"expected {key.expected()}")

    def _refuse(self, table: Table, name: str, keys: list[str]) -> None:
        if self.variant is None and name in table.all_keys():
            return  # what it belongs to is not known: that is the problem, and it is said
        if self.variant and name in table.all_keys():
            assert table.by is not None
            own = [key.name for key in table.variants[self.variant]]
            takes = ", ".join(own) or "no key of its own"
            self.problem(name, f"means nothing with {table.by.name} '{self.variant}'", f"it takes {takes}")
            return
        near = difflib.get_close_matches(name, keys, 1)
        self.problem(
            name, "unknown key", f"did you mean '{near[0]}'?" if near else f"expected one of {', '.join(keys)}"
        )

    def problem(self, key: str, message: str, cure: str = "") -> None:
        """Note what is wrong with a key."""
        self.problems.add(self.file, f"[{self.where}] {key}", message, cure)

    def named(self, key: str) -> bool:
        """Whether the file has the key, right or wrong."""
        return key in self._named

    def has(self, key: str) -> bool:
        """Whether the key is there and right."""
        return key in self._good

    def get(self, key: str, default: Any = None) -> Any:
        """The value of a key that is there and right, else the default."""
        return self._good.get(key, default)
