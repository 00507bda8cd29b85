"""Surfaces of a body: of sets of nodes, and what nothing holds, its outside, the walls of its voids, that of a cut."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from warpbrain.arrays import Bools, Floats, Int32s, Ints
from warpbrain.errors import InputError
from warpbrain.mesh.surface import closed_surfaces, face_vectors, in_rows, interface_faces, node_vectors, nodes_of, unit
from warpbrain.mesh.tet_mesh import TetMesh

#: The outside of a body, the wall of a void within it, and what was inside until tetrahedra were taken out.
Origin = Literal["outer", "inner", "cut"]
_ORIGINS: tuple[Origin, ...] = ("outer", "inner", "cut")


@dataclass(frozen=True, eq=False)
class FreeSurface:
    """A part of the surface on which something can act."""

    #: Of the node set that stands for it: what acts on that acts on its triangles, and on none that can move beside.
    name: str
    words: str  # what people call it
    members: Bools  # (n,), nodes of that set
    faces: Int32s  # (k, 3), triangles of the set that are not held, oriented outwards


@dataclass(frozen=True, eq=False)
class FreePart:
    """A connected free surface."""

    origin: Origin  # one of `Origin`
    faces: Int32s  # (k, 3), triangles, oriented outwards
    centre: Floats  # (3,), of its area [m]


def free_faces(mesh: TetMesh, members: Bools, held: Bools) -> Int32s:
    """Triangles (k, 3) of the boundary that a set of nodes holds and that can move: not all of their nodes are held."""
    faces = faces_of(mesh, members)
    return np.asarray(faces[~held[faces].all(axis=1)])


def free_parts(mesh: TetMesh, held: Bools, inner: ArrayLike, smallest: float = 0.0) -> list[FreePart]:
    """The connected free surfaces of a body.

    The boundary without triangles whose nodes are all held falls into pieces that hang together through edges; the
    wall of a cut, the walls of voids and the outside are apart even where they touch.

    `held` (n,): nodes that cannot move, or not along the normal. `inner` (n,): nodes on the walls of voids, as the body
    was before anything was cut out. `smallest`: part of the area of all pieces of one origin on one closed surface. A
    piece of less, such as a gap in what is held, belongs to the largest of them. Returns outside, voids, cuts; of each
    the largest area first.
    """
    faces = mesh.boundary
    free = ~held[faces].all(axis=1)
    faces, closed = faces[free], closed_surfaces(faces)[free]
    origin = np.where(np.asarray(inner, dtype=bool)[faces].all(axis=1), 1, 0)
    origin[in_rows(faces, mesh.cut)] = 2
    areas = np.linalg.norm(face_vectors(mesh.points, faces), axis=1)
    parts = []
    for kind, name in enumerate(_ORIGINS):
        pieces = [
            rows
            for surface in np.unique(closed[origin == kind])
            for rows in _pieces(faces, areas, np.flatnonzero((origin == kind) & (closed == surface)), smallest)
        ]
        for rows in sorted(pieces, key=lambda rows: -float(areas[rows].sum())):
            middles = mesh.points[faces[rows]].mean(axis=1)
            parts.append(FreePart(name, faces[rows], np.average(middles, axis=0, weights=areas[rows])))
    return parts


def _pieces(faces: Int32s, areas: Floats, rows: Ints, smallest: float) -> Iterator[Ints]:
    """Rows of each piece of some triangles of one closed surface."""
    piece = closed_surfaces(faces[rows])
    size = np.bincount(piece, areas[rows])
    piece = np.where(size[piece] < smallest * size.sum(), int(size.argmax()), piece)
    for number in np.unique(piece):
        yield rows[piece == number]


def rim_corners(mesh: TetMesh) -> Int32s:
    """Triangles (k, 3) of the cut whose nodes are all on its rim: a set of nodes of the surface beside holds them."""
    beside = mesh.boundary[~in_rows(mesh.boundary, mesh.cut)]
    return np.asarray(mesh.cut[nodes_of(beside, len(mesh.points))[mesh.cut].all(axis=1)])


def faces_of(mesh: TetMesh, members: Bools) -> Int32s:
    """Triangles of the boundary that a set of nodes holds.

    A triangle of the surface beside a cut can have all its nodes on the cut's rim. It is no part of the wall: where all
    members on the boundary are nodes of the cut, the set has triangles of the cut alone.

    `members` (n,). Returns (k, 3): node ids, oriented outwards: triangles all of whose nodes are members.
    """
    faces = mesh.boundary
    held = faces[members[faces].all(axis=1)]
    beside = members & nodes_of(faces, len(members)) & ~nodes_of(mesh.cut, len(members))
    if not len(mesh.cut) or beside.any():
        return held
    return np.asarray(held[in_rows(held, mesh.cut)])


def faces_of_set(mesh: TetMesh, name: str, who: str) -> Int32s:
    """Boundary triangles (k, 3) all of whose nodes are in a node set; `who` asks for them, for the message.

    `InputError` if there is no such set or no such triangle.
    """
    if name not in mesh.node_sets:
        known = ", ".join(sorted(mesh.node_sets)) or "none"
        raise InputError(f"{who}: the mesh has no node set '{name}', found {known}")
    faces = faces_of(mesh, mesh.node_sets[name])
    if len(faces) == 0:
        raise InputError(f"{who}: no boundary triangle of the mesh has all its nodes in the set '{name}'")
    return faces


def wall_nodes(mesh: TetMesh, elements: str) -> Bools:
    """Nodes (n,) of the wall that taking out an element set leaves: of its faces with tetrahedra that stay."""
    return nodes_of(interface_faces(mesh.tetrahedra, mesh.element_sets[elements]), len(mesh.points))


def vertex_normals(mesh: TetMesh) -> Floats:
    """Outward unit normals (n, 3) at the nodes of the boundary, means over their faces; zero at all other nodes."""
    return unit(node_vectors(mesh.points, mesh.boundary))
