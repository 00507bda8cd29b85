"""The node sets that a case's tables name: arrays of the mesh, or files of node numbers."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.format.table import Reading
from warpbrain.cases.parts.anatomy import node_ids
from warpbrain.cases.parts.context import Context
from warpbrain.mesh import MeshInFile, TetMesh

Bools = NDArray[np.bool_]


@dataclass
class NodeSets:
    """Looks sets up by the name that a table gives.

    Attributes
    ----------
    context : Context
    found : MeshInFile
    added : dict
        Sets that came from files.
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
        members = None if path is None else node_ids(self.context, path, self.found)
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
        """The mesh with the sets that came from files."""
        mesh = self.found.mesh
        if not self.added:
            return mesh
        sets = {**mesh.node_sets, **self.added}
        return TetMesh(mesh.points, mesh.tetrahedra, mesh.tissue, sets, mesh.element_sets)
