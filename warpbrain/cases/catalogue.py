"""What the shipped cases are, without reading their meshes: `python -m warpbrain.cases.catalogue` writes it anew.

A test holds every number against the case that is read.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

from warpbrain.atomic import whole_file
from warpbrain.cases.shipped import SHIPPED, find_case

_FILE = Path(__file__).parent / "data" / "catalogue.json"


@dataclass(frozen=True)
class Entry:
    """A shipped case with one of its meshes.

    Attributes
    ----------
    name : str
    tissue : str
        ``"multi"`` or ``"single"``.
    title, origin : str
        As `Case` has them.
    nodes, tetrahedra : int
        Of the imaged anatomy, whole.
    volume_cm3 : float
    recordings : dict of str to int
        How many rows, points or instants each has.
    """

    name: str
    tissue: str
    title: str
    origin: str
    nodes: int
    tetrahedra: int
    volume_cm3: float
    recordings: dict[str, int]


def catalogue() -> list[Entry]:
    """Every shipped case, each once for every mesh."""
    return [Entry(**entry) for entry in json.loads(_FILE.read_text(encoding="utf-8"))]


def read_entry(name: str, tissue: str) -> Entry:
    """An entry from the case itself."""
    from warpbrain.recordings.recording import count_of

    case = find_case(name, tissue)
    return Entry(
        name,
        tissue,
        case.title,
        case.origin,
        len(case.mesh.points),
        len(case.mesh.tetrahedra),
        round(1e6 * case.mesh.volume, 1),
        {recording.name: count_of(recording) for recording in case.recordings},
    )


def write_catalogue() -> None:
    """Write the catalogue from the cases."""
    entries = [asdict(read_entry(name, tissue)) for name, variants in SHIPPED.items() for tissue in variants]
    lines = ",\n".join(json.dumps(entry, ensure_ascii=False) for entry in entries)
    with whole_file(_FILE) as scratch:
        scratch.write_text(f"[\n{lines}\n]\n", encoding="utf-8")


if __name__ == "__main__":
    write_catalogue()
