"""Abaqus input files: nodes and cells as meshio reads them, sets by the numbers that the file gives.

meshio's own sets of elements are of another block where an `*ELEMENT` line without `ELSET` stands before one with it,
have lost elements where two lines name one set, and a set that names another in other letters ends its reading: sets
are taken out before it reads, and read here. Keywords: Abaqus Analysis User's Guide, input syntax rules; names are one
whatever their case.
"""

from __future__ import annotations

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
class AbaqusSets:
    """What a file names."""

    nodes: list[int] = field(default_factory=list)  # numbers of the nodes in the order of the file, which is meshio's
    #: Numbers of the elements of each `*ELEMENT` line, which is a block of meshio's.
    elements: list[list[int]] = field(default_factory=list)
    #: Numbers of the members.
    node_sets: dict[str, list[int]] = field(default_factory=dict)
    element_sets: dict[str, list[int]] = field(default_factory=dict)
    #: Names of the sets that `*SOLID SECTION` gives a material, and of those that `*ELEMENT` lines make.
    sections: list[str] = field(default_factory=list)
    of_elements: list[str] = field(default_factory=list)


def read_abaqus(path: Path) -> Any:
    """Read a file: a `meshio.Mesh` with its sets; `info[MATERIAL_SETS]` lists which of them may be the materials.

    `MeshError` if a set cannot be understood or has what is not there, or the file includes another one.
    """
    import meshio

    sets, plain = _sets_and_rest(path.read_text(encoding="utf-8", errors="replace"))
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / path.name
        copy.write_text(plain, encoding="utf-8")
        raw = meshio.read(copy, file_format="abaqus")
    if len(sets.nodes) != len(raw.points) or [len(ids) for ids in sets.elements] != [len(b.data) for b in raw.cells]:
        raise MeshError("lines of *NODE or *ELEMENT are not one node or one element each")
    where = {number: index for index, number in enumerate(sets.nodes)}
    blocks = [{number: index for index, number in enumerate(ids)} for ids in sets.elements]
    known = set().union(*blocks)
    for name, ids, there in (
        *((name, ids, where) for name, ids in sets.node_sets.items()),
        *((name, ids, known) for name, ids in sets.element_sets.items()),
    ):
        absent = next((number for number in ids if number not in there), None)
        if absent is not None:
            raise MeshError(f"set '{name}' has {absent}, which the file does not define")
    raw.point_sets = {
        name: np.array([where[number] for number in ids], dtype=np.int64) for name, ids in sets.node_sets.items()
    }
    raw.cell_sets = {
        name: [np.array([block[number] for number in ids if number in block], dtype=np.int64) for block in blocks]
        for name, ids in sets.element_sets.items()
    }
    by_name = {name.upper(): name for name in sets.element_sets}
    raw.info = {
        MATERIAL_SETS: [
            list(dict.fromkeys(by_name[name.upper()] for name in names if name.upper() in by_name))
            for names in (sets.sections, sets.of_elements)
        ]
    }
    return raw


def _sets_and_rest(text: str) -> tuple[AbaqusSets, str]:
    """The sets of a file, and its nodes and elements without them."""
    sets = AbaqusSets()
    spelling: dict[tuple[str, str], str] = {}
    plain: list[str] = []
    for keyword, options, rows in _parts(enumerate(text.splitlines(), 1)):
        if keyword == "INCLUDE":
            raise MeshError("*INCLUDE: one file is read: put the text of the other in its place")
        try:
            _take(sets, spelling, keyword, options, rows)
        except (ValueError, IndexError):
            where = f"lines {rows[0][0]} to {rows[-1][0]}" if rows else "without lines"
            raise MeshError(f"*{keyword}, {where}: expected numbers or names of sets") from None
        if keyword in ("NODE", "ELEMENT"):
            kind = f", TYPE={options['TYPE']}" if "TYPE" in options else ""
            plain += [f"*{keyword}{kind}", *(row for _, row in rows)]
    return sets, "\n".join(plain) + "\n"


def _parts(lines: Iterator[tuple[int, str]]) -> Iterator[tuple[str, dict[str, str], list[tuple[int, str]]]]:
    """Each keyword with its options and the numbered lines of data after it."""
    keyword, options, rows = "", dict[str, str](), list[tuple[int, str]]()
    for number, line in lines:
        text = line.strip()
        if text.startswith("**") or not text:
            continue
        if not text.startswith("*"):
            rows.append((number, text))
            continue
        yield keyword, options, rows
        words = [word.partition("=") for word in text[1:].split(",")]
        keyword = words[0][0].strip().upper()
        options = {name.strip().upper(): value.strip().strip('"') for name, _, value in words[1:]}
        rows = []
    yield keyword, options, rows


def _take(
    sets: AbaqusSets,
    spelling: dict[tuple[str, str], str],
    keyword: str,
    options: dict[str, str],
    rows: list[tuple[int, str]],
) -> None:
    kind = "NSET" if keyword in ("NODE", "NSET") else "ELSET"
    of = sets.node_sets if kind == "NSET" else sets.element_sets
    named = [options[kind]] if options.get(kind) else []
    if keyword == "NODE":
        numbers = [int(text.split(",")[0]) for _, text in rows]
        sets.nodes += numbers
    elif keyword == "ELEMENT":
        numbers = _elements(rows)
        sets.elements.append(numbers)
        sets.of_elements += named
    elif keyword == "SOLID SECTION":
        sets.sections += named
        return
    elif keyword in ("NSET", "ELSET"):
        numbers = _members(rows, "GENERATE" in options, keyword, of, spelling)
    else:
        return
    for name in named:
        of.setdefault(spelling.setdefault((kind, name.upper()), name), []).extend(numbers)


def _elements(rows: list[tuple[int, str]]) -> list[int]:
    """First number of each element; one whose line ends in a comma goes on in the next."""
    numbers = []
    goes_on = False
    for _, text in rows:
        if not goes_on:
            numbers.append(int(text.split(",")[0]))
        goes_on = text.endswith(",")
    return numbers


def _members(
    rows: list[tuple[int, str]],
    generate: bool,
    kind: str,
    known: dict[str, list[int]],
    spelling: dict[tuple[str, str], str],
) -> list[int]:
    numbers: list[int] = []
    for _, text in rows:
        words = [word.strip().strip('"') for word in text.split(",") if word.strip()]
        if generate:
            first, last, *step = map(int, words)
            numbers += range(first, last + 1, step[0] if step else 1)
            continue
        for word in words:
            if word.lstrip("-").isdigit():
                numbers.append(int(word))
            elif (kind, word.upper()) in spelling:
                numbers += known[spelling[kind, word.upper()]]
            else:
                raise ValueError(word)
    return numbers
