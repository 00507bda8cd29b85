"""What keys of a case name: sets of the mesh, tissues, and files that add to it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.cases.case import Tissue
from warpbrain.cases.format.reading import Reading
from warpbrain.frame import Frame
from warpbrain.mesh import MeshError, MeshInFile, TetMesh, read_mesh, wall_nodes
from warpbrain.mesh.quality import open_edges
from warpbrain.physics.mechanism import ClosedSurface
from warpbrain.problems import Problems
from warpbrain.recordings.surfaces import read_surface_mesh
from warpbrain.recordings.tables import read_table
from warpbrain.recordings.text import (
    collected,
    lines_of,
    read_text,
    remark_open_end,
    require_readable,
    shown,
    without_comment,
)

#: Endings of files that hold directions of elements: a table, an array of NumPy, or the same mesh with one array.
_DIRECTIONS = (".csv", ".npy", ".vtu", ".vtk", ".xdmf", ".msh")


@dataclass
class Named:
    """Looks up what a key names, and adds to the mesh what comes from elsewhere."""

    #: The whole anatomy; it gains an element set for each tissue that is named as one, the nodes of the wall of each
    #: element set that is named as a node set, sets of nodes and vectors of elements from files.
    mesh: TetMesh
    tissues: Mapping[int, Tissue]
    frame: Frame  # of the files
    problems: Problems
    in_file: MeshInFile | None = None  # how the file of the mesh numbers its nodes, which files may name

    def nodes(self, table: Reading) -> str | None:
        """Name of the node set that the key `nodes` of a table names; None, and a problem noted, if there is none."""
        if not table.has("nodes"):
            return None
        name: str = table.get("nodes")
        if name.lower().endswith(".csv"):
            path = table.path("nodes")
            if path is None or self.in_file is None:
                return None
            members = _read_members(path, self.in_file, self.problems)
            if members is None:
                return None
            name = path.stem
            while not np.array_equal(self.mesh.node_sets.get(name, members), members):
                name += "-file"
            self._add_nodes(name, members)
            return name
        if name not in self.mesh.node_sets and name in self.mesh.element_sets:
            self._add_nodes(name, wall_nodes(self.mesh, name))
        elif name not in self.mesh.node_sets:
            known = ", ".join(sorted(self.mesh.node_sets)) or "none"
            message = f"the mesh has no node set '{name}' (it has {known})"
            table.problem("nodes", message, "a point array, non-zero: member")
            return None
        elif not self.mesh.node_sets[name].any():
            table.problem("nodes", f"node set '{name}' is empty")
            return None
        return name

    def look_up(self, kind: str, name: str, path_of: Callable[[], Path | None]) -> str | ClosedSurface | None:
        """What a mechanism takes for a name of a kind of `warpbrain.physics.mechanism.KINDS`.

        `path_of`: the file of that name; None, and the problem noted, if there is none. Returns None, and a problem
        noted, if a file is missing or wrong. A name of nothing is returned as it is: the mechanism says what the mesh
        has.
        """
        if kind == "element set" or (kind == "node set" and name not in self.mesh.node_sets):
            labels = [label for label, tissue in self.tissues.items() if tissue.name == name]
            if labels and name not in self.mesh.element_sets:
                members = np.isin(self.mesh.tissue, labels)
                self.mesh = replace(self.mesh, element_sets={**self.mesh.element_sets, name: members})
            if kind == "node set" and name in self.mesh.element_sets:
                self._add_nodes(name, wall_nodes(self.mesh, name))
        if kind == "surface":
            path = path_of()
            return None if path is None else read_closed_surface(path, name, self.frame, self.problems)
        if kind == "directions" and name not in self.mesh.element_vectors and name.lower().endswith(_DIRECTIONS):
            path = path_of()
            vectors = None if path is None else read_directions(path, self.mesh, self.frame, self.problems)
            if vectors is None:
                return None
            self.mesh = replace(self.mesh, element_vectors={**self.mesh.element_vectors, name: vectors})
        return name

    def _add_nodes(self, name: str, members: Bools) -> None:
        self.mesh = self.mesh.with_node_sets({**self.mesh.node_sets, name: members})


def _read_members(path: Path, in_file: MeshInFile, problems: Problems) -> Bools | None:
    """Members (n,) of a set given as a file of node numbers, one a line, from 0; None if something is wrong."""
    where = np.full(in_file.file_nodes, -1, dtype=np.int64)
    where[in_file.node_numbers] = np.arange(len(in_file.node_numbers))
    members = np.zeros(len(in_file.mesh.points), dtype=bool)
    with collected(path, problems) as wrong:
        text = read_text(path, wrong)
        remark_open_end(path, text, wrong)
        words = [(number, without_comment(line).strip().rstrip(",;")) for number, line in enumerate(lines_of(text), 1)]
        words = [(number, word) for number, word in words if word]
        if words and words[0][1].lower() in ("id", "ids", "node", "nodes"):
            del words[0]
        for number, word in words:
            if fault := _fault(word, where):
                wrong.add(path, f"row {number}", fault)
            else:
                members[where[int(word)]] = True
        if not wrong and not members.any():
            wrong.add(path, "", "the file names no node: the set is empty")
    return None if wrong else members


def _fault(word: str, where: Ints) -> str:
    """What is wrong with the number of a node; empty if nothing is."""
    if not (word.isascii() and word.isdigit()):
        return f"expected the number of a node, found {shown(word)}"
    # a number of thousands of digits is not turned into one
    if len(word) > 12 or int(word) >= len(where):
        return f"found node {shown(word)}, but the mesh has nodes 0 to {len(where) - 1}"
    if where[int(word)] < 0:
        return f"node {word} is on an edge of a second-order tetrahedron, and only corners are used"
    return ""


def read_closed_surface(path: Path, name: str, frame: Frame, problems: Problems) -> ClosedSurface | None:
    """The closed surface in a file, in metres and RAS, called by a name; None if it is none or is not closed."""
    with collected(path, problems) as wrong:
        points, faces, axes = read_surface_mesh(path, wrong)
        if faces is None:
            wrong.refuse(path, "", "found points only, expected a surface of triangles")
        if len(edges := open_edges(faces)):
            first = f"first that of the points {edges[0][0]} and {edges[0][1]}"
            message = f"the surface is not closed: {len(edges)} edge(s) do not belong to two triangles, {first}"
            wrong.refuse(path, "", message, "contact needs an inside: close the surface")
        points = Frame(frame.unit, axes or frame.axes).lengths(points)
    return None if wrong else ClosedSurface(name, points, faces)


def read_directions(path: Path, mesh: TetMesh, frame: Frame, problems: Problems) -> Floats | None:
    """Vectors (m, 3), RAS, one for each element of a mesh in its order; None if something is wrong.

    A .csv has the columns x, y and z; an .npy is an array (m, 3); a mesh file has the same tetrahedra and one array of
    three columns.
    """
    ending, columns = path.suffix.lower(), ("x", "y", "z")
    with collected(path, problems) as wrong:
        if ending == ".csv":
            table = read_table(path, wrong, columns)
            table.require(*columns)
            vectors = table.vectors(*columns)
        else:
            vectors = (_directions_in_array if ending == ".npy" else _directions_in_mesh)(path, mesh, wrong)
        if not wrong and vectors.shape != (len(mesh.tetrahedra), 3):
            shape = " x ".join(map(str, vectors.shape))
            wrong.add(path, "", f"found {shape} numbers, expected {len(mesh.tetrahedra)} x 3: a row for each element")
    return None if wrong else frame.directions(vectors)


def _directions_in_array(path: Path, mesh: TetMesh, problems: Problems) -> Floats:
    require_readable(path, problems)
    try:
        # mapped, so that a header with more numbers than the file has is known before any memory is taken
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    except Exception as error:  # headers are Python text: random ones raise what its tokenizer does
        problems.refuse(path, "", f"not an array of NumPy ({' '.join(str(error).split())[:100]})")
    if not isinstance(array, np.ndarray) or array.dtype.kind not in "iuf":
        problems.refuse(path, "", "expected one array of real numbers")
    # checked before it is read
    return array if array.shape != (len(mesh.tetrahedra), 3) else array.astype(np.float64)


def _directions_in_mesh(path: Path, mesh: TetMesh, problems: Problems) -> Floats:
    try:
        other = read_mesh(path)
    except MeshError as error:
        problems.refuse(path, "", str(error).removeprefix(f"{path}: "))
    if not np.array_equal(other.tetrahedra, mesh.tetrahedra):
        problems.refuse(path, "", "its tetrahedra are not those of the mesh, in their order")
    if len(other.element_vectors) != 1:
        names = ", ".join(sorted(other.element_vectors)) or "none"
        problems.refuse(path, "", f"expected one real array of three columns, found {names}")
    return next(iter(other.element_vectors.values()))
