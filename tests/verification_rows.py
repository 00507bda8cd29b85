"""Rows of docs/verification.md: a claim, its independent reference, the error that a test measured, and its bound.

`docs/make_verification.py` runs the tests that use the fixture `verify` and writes the table.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Measurement:
    """One comparison with a reference.

    Parameters
    ----------
    claim : str
        What is computed, in the field's words.
    reference : str
        What it is compared with, and who computed that.
    error, bound : float
        Measured and largest allowed error, in `unit`.
    unit : str
        Empty for a relative error.
    test : str
        Node of pytest that measured it.
    """

    claim: str
    reference: str
    error: float
    bound: float
    unit: str
    test: str


class Row:
    """What a test says of what it verifies; `verify(claim, reference, error, bound)` may be called several times."""

    def __init__(self, test: str) -> None:
        self.test = test
        self.measurements: list[Measurement] = []

    def __call__(self, claim: str, reference: str, error: float, bound: float, unit: str = "") -> None:
        """Record an error and assert that it is within its bound (an error that is not a number never is)."""
        self.measurements.append(Measurement(claim, reference, float(error), float(bound), unit, self.test))
        assert error <= bound, f"{claim}: {error:.3g} {unit} against {reference}, allowed {bound:.3g}"


class Rows:
    """The measurements of a whole run of pytest."""

    def __init__(self) -> None:
        self.measurements: list[Measurement] = []

    def add(self, row: Row) -> None:
        self.measurements.extend(row.measurements)

    def as_dicts(self) -> list[dict[str, Any]]:
        return [asdict(m) for m in self.measurements]

    def add_dicts(self, rows: Iterable[dict[str, Any]]) -> None:
        self.measurements.extend(Measurement(**row) for row in rows)

    def write(self, file: str) -> None:
        Path(file).write_text(json.dumps(self.as_dicts(), indent=1), encoding="utf-8")


def worst(measurements: Iterable[Measurement]) -> list[Measurement]:
    """Of measurements with one claim and reference the one that is nearest to its bound, in the order they came."""
    rows: dict[tuple[str, str], Measurement] = {}
    for m in measurements:
        key = (m.claim, m.reference)
        if key not in rows or m.error / m.bound > rows[key].error / rows[key].bound:
            rows[key] = m
    return list(rows.values())
