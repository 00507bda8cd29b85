"""Abaqus input files: nodes and cells as meshio reads them, sets by the numbers that the file gives.

meshio's own sets of elements are of another block where an `*ELEMENT` line without `ELSET` stands before one with it,
have lost elements where two lines name one set, and a set that names another in other letters ends its reading: sets
are taken out before it reads, and read here. Keywords: Abaqus Analysis User's Guide, input syntax rules; names are one
whatever their case.
"""

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.mesh.tet_mesh import MeshError

#: Key of `info` of what is read.
MATERIAL_SETS = "material sets"


@dataclass
class _Named:
    """What a file names."""

    nodes: list[int] = field(default_factory=list)  # numbers of the nodes in the order of the file, which is meshio's
    #: Numbers of the elements of each `*ELEMENT` line, which is a block of meshio's.
    elements: list[list[int]] = field(default_factory=list)
    #: By kind and name in capitals: the name as it is first written, and numbers of the members.
    sets: dict[str, dict[str, tuple[str, list[int]]]] = field(default_factory=lambda: {"NSET": {}, "ELSET": {}})
    #: Names of the sets that `*SOLID SECTION` gives a material, and of those that `*ELEMENT` lines make.
    sections: list[str] = field(default_factory=list)
    of_elements: list[str] = field(default_factory=list)


def read_abaqus(path: Path) -> Any:
    """Read a file: a `meshio.Mesh` with its sets; `info[MATERIAL_SETS]` lists which of them may be the materials.

    `MeshError` if a set cannot be understood or has what is not there, or the file includes another one.
    """
    import meshio

    named, plain = _Named(), ""
    for keyword, options, rows in _parts(path.read_text(encoding="utf-8", errors="replace")):
        if keyword == "INCLUDE":
            raise MeshError("*INCLUDE: one file is read: put the text of the other in its place")
        try:
            _take(named, keyword, options, [text for _, text in rows])
        except (ValueError, IndexError, KeyError):
            where = f"lines {rows[0][0]} to {rows[-1][0]}" if rows else "without lines"
            raise MeshError(f"*{keyword}, {where}: expected numbers or names of sets") from None
        if keyword in ("NODE", "ELEMENT"):
            kind = f", TYPE={options['TYPE']}" if "TYPE" in options else ""
            plain += "\n".join([f"*{keyword}{kind}", *(row for _, row in rows), ""])
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / path.name
        copy.write_text(plain or "\n", encoding="utf-8")
        raw = meshio.read(copy, file_format="abaqus")
    if len(named.nodes) != len(raw.points) or [len(ids) for ids in named.elements] != [len(b.data) for b in raw.cells]:
        raise MeshError("lines of *NODE or *ELEMENT are not one node or one element each")
    index = {number: place for place, number in enumerate(named.nodes)}
    blocks = [{number: place for place, number in enumerate(ids)} for ids in named.elements]
    node_sets, element_sets = named.sets["NSET"], named.sets["ELSET"]
    for sets, known in ((node_sets, index.keys()), (element_sets, set().union(*blocks))):
        for name, ids in sets.values():
            if absent := [number for number in ids if number not in known]:
                raise MeshError(f"set '{name}' has {absent[0]}, which the file does not define")
    raw.point_sets = {
        name: np.array([index[number] for number in ids], dtype=np.int64) for name, ids in node_sets.values()
    }
    raw.cell_sets = {
        name: [np.array([block[number] for number in ids if number in block], dtype=np.int64) for block in blocks]
        for name, ids in element_sets.values()
    }
    raw.info = {
        MATERIAL_SETS: [
            list(dict.fromkeys(element_sets[name.upper()][0] for name in names if name.upper() in element_sets))
            for names in (named.sections, named.of_elements)
        ]
    }
    return raw


def _parts(text: str) -> Iterator[tuple[str, dict[str, str], list[tuple[int, str]]]]:
    """Each keyword with its options and the numbered lines of data after it."""
    keyword, options, rows = "", dict[str, str](), list[tuple[int, str]]()
    for number, line in enumerate(map(str.strip, text.splitlines()), 1):
        if line.startswith("**") or not line:
            continue
        if not line.startswith("*"):
            rows.append((number, line))
            continue
        yield keyword, options, rows
        words = [word.partition("=") for word in line[1:].split(",")]
        keyword = words[0][0].strip().upper()
        options = {name.strip().upper(): value.strip().strip('"') for name, _, value in words[1:]}
        rows = []
    yield keyword, options, rows


def _take(named: _Named, keyword: str, options: dict[str, str], rows: list[str]) -> None:
    kind = "NSET" if keyword in ("NODE", "NSET") else "ELSET"
    sets = named.sets[kind]
    names = [options[kind]] if options.get(kind) else []
    if keyword in ("NODE", "ELEMENT"):
        # an element whose line ends in a comma goes on in the next
        lines = zip(rows, ["", *rows], strict=False)
        numbers = [int(row.split(",")[0]) for row, last in lines if keyword == "NODE" or not last.endswith(",")]
        if keyword == "NODE":
            named.nodes += numbers
        else:
            named.elements.append(numbers)
            named.of_elements += names
    elif keyword in ("NSET", "ELSET"):
        numbers = []
        for row in rows:
            words = [word.strip().strip('"') for word in row.split(",") if word.strip()]
            if "GENERATE" in options:
                first, last, *step = map(int, words)
                numbers += range(first, last + 1, step[0] if step else 1)
                continue
            for word in words:
                numbers += [int(word)] if word.lstrip("-").isdigit() else sets[word.upper()][1]
    else:
        named.sections += names if keyword == "SOLID SECTION" else []
        return
    for name in names:
        sets.setdefault(name.upper(), (name, []))[1].extend(numbers)
