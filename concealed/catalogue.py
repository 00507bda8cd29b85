"""Writes what the shipped cases are, so that a list of them reads no mesh: `python -m concealed.catalogue`.

A test holds every number against the case that is read.
"""

from __future__ import annotations

import json
from dataclasses import asdict

from warpbrain.atomic import whole_file
from warpbrain.cases.case import Case
from warpbrain.cases.shipped import CATALOGUE, SHIPPED, Entry, find_case


def entry_of(case: Case, name: str, tissue: str) -> Entry:
    """What a case is that is found by a name."""
    return Entry(
        name,
        tissue,
        case.title,
        case.origin,
        len(case.mesh.points),
        len(case.mesh.tetrahedra),
        round(1e6 * case.mesh.volume, 1),
        {recording.name: recording.count for recording in case.recordings},
    )


if __name__ == "__main__":
    entries = [
        asdict(entry_of(find_case(name, tissue), name, tissue))
        for name, variants in SHIPPED.items()
        for tissue in variants
    ]
    lines = ",\n".join(json.dumps(entry, ensure_ascii=False) for entry in entries)
    with whole_file(CATALOGUE) as scratch:
        scratch.write_text(f"[\n{lines}\n]\n", encoding="utf-8")
