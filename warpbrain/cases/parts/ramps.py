"""Factors over time."""

from __future__ import annotations

import itertools

from warpbrain.cases.format.table import Reading


def read_ramp(table: Reading) -> tuple[tuple[float, float], ...] | None:
    """Pairs of time and factor; None if they are wrong."""
    if table.named("ramp") and not table.has("ramp"):
        return None
    ramp = tuple((float(t), float(f)) for t, f in table.get("ramp", []))
    for (a, _), (b, _) in itertools.pairwise(ramp):
        if b <= a:
            table.problem("ramp", f"times must increase, found {b:g} s after {a:g} s")
            return None
    return ramp
