"""What keys of mechanisms name: parts of the mesh, tissues, and files that add to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from warpbrain.cases.case import Tissue
from warpbrain.cases.parts.closed_surfaces import read_closed_surface
from warpbrain.cases.parts.directions import ENDINGS, read_directions
from warpbrain.frame import Frame
from warpbrain.mesh import TetMesh, wall_nodes
from warpbrain.physics.mechanism import ClosedSurface
from warpbrain.problems import Problems


@dataclass
class Named:
    """Looks up what a key names, and adds to the mesh what comes from elsewhere.

    Attributes
    ----------
    mesh : TetMesh
        The whole anatomy; it gains an element set for each tissue that is named as one, the nodes of the wall of each
        element set that is named as a node set, and vectors for each file.
    tissues : mapping of int to Tissue
    frame : Frame
        Of the files.
    problems : Problems
    """

    mesh: TetMesh
    tissues: Mapping[int, Tissue]
    frame: Frame
    problems: Problems

    def look_up(self, kind: str, name: str, path_of: Callable[[], Path | None]) -> str | ClosedSurface | None:
        """What a mechanism takes for a name of a kind of `warpbrain.physics.mechanism.KINDS`.

        Parameters
        ----------
        kind, name : str
        path_of : callable
            The file of that name; None, and the problem noted, if there is none.

        Returns
        -------
        str, ClosedSurface or None
            None, and a problem noted, if a file is missing or wrong. A name of nothing is returned as it is: the
            mechanism says what the mesh has.
        """
        if kind == "element set" and name not in self.mesh.element_sets:
            self._take_tissue(name)
        if kind == "node set" and name not in self.mesh.node_sets:
            self._take_wall(name)
        if kind == "surface":
            path = path_of()
            return None if path is None else read_closed_surface(path, name, self.frame, self.problems)
        if kind == "directions" and name not in self.mesh.element_vectors and name.lower().endswith(ENDINGS):
            path = path_of()
            found = None if path is None else read_directions(path, self.mesh, self.frame, self.problems)
            if found is None:
                return None
            self.mesh = replace(self.mesh, element_vectors={**self.mesh.element_vectors, name: found})
        return name

    def _take_tissue(self, name: str) -> None:
        labels = [label for label, tissue in self.tissues.items() if tissue.name == name]
        if labels:
            members = np.isin(self.mesh.tissue, labels)
            self.mesh = replace(self.mesh, element_sets={**self.mesh.element_sets, name: members})

    def _take_wall(self, name: str) -> None:
        if name not in self.mesh.element_sets:
            self._take_tissue(name)
        if name in self.mesh.element_sets:
            wall = wall_nodes(self.mesh, name)
            self.mesh = self.mesh.with_node_sets({**self.mesh.node_sets, name: wall})
