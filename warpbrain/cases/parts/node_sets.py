"""The node sets that a case's tables name: arrays of the mesh, walls of its element sets, or files of node numbers."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.format.table import Reading
from warpbrain.cases.parts.context import Context
from warpbrain.mesh import MeshInFile, TetMesh, wall_nodes
from warpbrain.problems import Problems
from warpbrain.recordings.text import collected, lines_of, read_text, remark_open_end, shown, without_comment

Bools = NDArray[np.bool_]


@dataclass
class NodeSets:
    """Looks sets up by the name that a table gives.

    Attributes
    ----------
    context : Context
    found : MeshInFile
    added : dict
        Sets that came from files, and walls of element sets.
    """

    context: Context
    found: MeshInFile
    added: dict[str, Bools] = field(default_factory=dict)

    def look_up(self, table: Reading, key: str = "nodes") -> str | None:
        """Name of the set in the mesh; None, and a problem noted, if there is none or nobody is in it."""
        if not table.has(key):
            return None
        name: str = table.get(key)
        if name.lower().endswith(".csv"):
            return self._from_file(table, key)
        sets = self.found.mesh.node_sets
        if name not in sets and name in self.found.mesh.element_sets:
            self.added[name] = wall_nodes(self.found.mesh, name)
            return name
        if name not in sets:
            known = ", ".join(sorted(sets)) or "none"
            table.problem(key, f"the mesh has no node set '{name}' (it has {known})", "a point array, non-zero: member")
            return None
        if not sets[name].any():
            table.problem(key, f"node set '{name}' is empty")
            return None
        return name

    def _from_file(self, table: Reading, key: str) -> str | None:
        path = self.context.path(table, key)
        members = None if path is None else _read_numbers(path, self.found, self.context.problems)
        if path is None or members is None:
            return None
        name = path.stem
        while name in self.found.mesh.node_sets or not np.array_equal(self.added.get(name, members), members):
            name += "-file"
        self.added[name] = members
        return name

    def members(self, name: str) -> Bools:
        """Members (n,) of a set that was looked up."""
        return self.added[name] if name in self.added else self.found.mesh.node_sets[name]

    def mesh(self) -> TetMesh:
        """The mesh with the sets that were added."""
        mesh = self.found.mesh
        if not self.added:
            return mesh
        return mesh.with_node_sets({**mesh.node_sets, **self.added})


def _read_numbers(path: Path, found: MeshInFile, problems: Problems) -> Bools | None:
    """Members (n,) of a set given as a file of node numbers, one a line, from 0; None if something is wrong."""
    text = read_text(path, problems)
    if text is None:
        return None
    where = np.full(found.file_nodes, -1, dtype=np.int64)
    where[found.node_numbers] = np.arange(len(found.node_numbers))
    remark_open_end(path, text, problems)
    members = np.zeros(len(found.mesh.points), dtype=bool)
    with collected(path, problems) as wrong:
        first = True
        for number, line in enumerate(lines_of(text), 1):
            if wrong.enough:
                break
            word = without_comment(line).strip().rstrip(",;")
            if not word:
                continue
            header, first = first and word.lower() in ("id", "ids", "node", "nodes"), False
            if header:
                continue
            fault = _fault(word, where)
            if fault:
                wrong.add(path, f"row {number}", fault)
            else:
                members[where[int(word)]] = True
    if not wrong and not members.any():
        problems.add(path, "", "the file names no node: the set is empty")
        return None
    return None if wrong else members


def _fault(word: str, where: NDArray[np.int64]) -> str:
    """What is wrong with the number of a node; empty if nothing is."""
    if not (word.isascii() and word.isdigit()):
        return f"expected the number of a node, found {shown(word)}"
    # a number of thousands of digits is not turned into one
    if len(word) > 12 or int(word) >= len(where):
        return f"found node {shown(word)}, but the mesh has nodes 0 to {len(where) - 1}"
    if where[int(word)] < 0:
        return f"node {word} is on an edge of a second-order tetrahedron, and only corners are used"
    return ""
