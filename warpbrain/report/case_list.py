"""The list of shipped cases, in words."""

from __future__ import annotations

from collections.abc import Sequence

from warpbrain.cases.shipped import Entry

_ROW = "{:<14} {:<7} {:<10} {:>7} {:>9} {:>9}   {}"


def list_lines(entries: Sequence[Entry]) -> list[str]:
    """A head, and one line about each case."""
    lines = [_ROW.format("case", "tissue", "origin", "nodes", "elements", "cm3", "recordings")]
    for entry in entries:
        recordings = ", ".join(f"{name} ({count})" for name, count in entry.recordings.items()) or "none"
        numbers = (entry.nodes, entry.tetrahedra, f"{entry.volume_cm3:.1f}")
        lines.append(_ROW.format(entry.name, entry.tissue, entry.origin, *numbers, recordings))
    return lines
