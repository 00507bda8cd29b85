"""The same body in smaller elements: every tetrahedron cut into eight of an eighth of its volume."""

from collections.abc import Mapping
from dataclasses import replace
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Bools, Floats, Int32s, Ints
from warpbrain.mesh.surface import EDGES, in_rows, nodes_of
from warpbrain.mesh.tet_mesh import TetMesh

#: Corners 0 to 3 and the midpoints of edges 01, 02, 03, 12, 13, 23 as 4 to 9: what is cut off at each corner.
_CORNERS = np.array([[0, 4, 5, 6], [4, 1, 7, 8], [5, 7, 2, 9], [6, 8, 9, 3]])
#: Diagonals of the octahedron that is left, each with the other four corners in a ring about it.
_DIAGONALS = np.array([[4, 9], [5, 8], [6, 7]])
_RINGS = np.array([[5, 6, 8, 7], [4, 7, 9, 6], [4, 5, 9, 8]])


def refined(mesh: TetMesh) -> tuple[TetMesh, Int32s]:
    """Cut every tetrahedron into eight, through the midpoints of its edges.

    The four at the corners are similar to the whole; the octahedron between them is cut along its shortest diagonal, so
    that elements do not become worse without limit (Bey 1995, Computing 55, 355).

    Returns `mesh`: nodes 0 to n - 1 are those of the mesh it is of, elements 8 e to 8 e + 7 are in element e. Midpoints
    are in node sets by the rule of `inherited`; `ends` (n', 2): for each node the two between which it lies in the
    middle; an old one lies between itself and itself.
    """
    sides = np.sort(mesh.tetrahedra[:, EDGES], axis=2).reshape(-1, 2)
    edges, number = np.unique(sides, axis=0, return_inverse=True)
    count = len(mesh.points)
    points = np.concatenate([mesh.points, mesh.points[edges].mean(axis=1)])
    nodes = np.concatenate([mesh.tetrahedra, count + number.reshape(-1, 6)], axis=1)
    children = np.concatenate([nodes[:, _CORNERS], _octahedra(points, nodes)], axis=1).reshape(-1, 4)
    ends = np.concatenate([np.repeat(np.arange(count)[:, None], 2, axis=1), edges]).astype(np.int32)
    element_sets = {name: np.repeat(members, 8) for name, members in mesh.element_sets.items()}
    element_vectors = {name: np.repeat(vectors, 8, axis=0) for name, vectors in mesh.element_vectors.items()}
    tissue = np.repeat(mesh.tissue, 8)
    finer = TetMesh(points, children, tissue, {}, element_sets, element_vectors)
    finer = replace(finer, cut=_finer_cut(mesh.cut, ends, finer)) if len(mesh.cut) else finer
    return finer.with_node_sets(inherited_sets(mesh.node_sets, ends, finer)), ends


def edge_numbers(edges: Int32s, wanted: NDArray[np.integer], count: int) -> Ints:
    """Numbers (...,) of edges (..., 2), their ends ascending, among all edges (E, 2) of a mesh of `count` nodes."""
    factors = np.array([count, 1])
    return np.searchsorted(edges.astype(np.int64) @ factors, wanted.astype(np.int64) @ factors).astype(np.int64)


#: Finer meshes by those they are of.
_FINER: WeakKeyDictionary[TetMesh, tuple[TetMesh, Int32s]] = WeakKeyDictionary()


def finer_mesh(mesh: TetMesh) -> tuple[TetMesh, Int32s]:
    """What `refined` returns, made once: elements are shared by meshes that differ in their node sets only."""
    if mesh not in _FINER:
        if "finer" not in mesh.shared:
            mesh.shared["finer"] = _FINER[mesh] = refined(mesh)
        else:
            finer, ends = mesh.shared["finer"]
            _FINER[mesh] = finer.with_node_sets(inherited_sets(mesh.node_sets, ends, finer)), ends
    return _FINER[mesh]


def _finer_cut(cut: Int32s, ends: Int32s, finer: TetMesh) -> Int32s:
    """Triangles of the finer boundary that lie in triangles of a cut: four of each."""
    faces = finer.boundary
    # of a part at a corner the ends are a, a, a, b, a, c; of that in the middle a, b, b, c, c, a
    corners = np.sort(ends[faces].reshape(-1, 6), axis=1)
    first, last = corners[:, :1], corners[:, -1:]
    between = np.where((corners != first) & (corners != last), corners, -1).max(axis=1, keepdims=True)
    return np.asarray(faces[in_rows(np.concatenate([first, between, last], axis=1), cut)])


def inherited_sets(sets: Mapping[str, Bools], ends: Int32s, finer: TetMesh) -> dict[str, Bools]:
    """Sets of nodes of a mesh on the finer one, by the rule of `inherited`.

    The wall of a cut stays one: a set that has no node of the surface beside it gains none (`faces_of`).
    """
    surface, cut = nodes_of(finer.boundary, len(ends)), nodes_of(finer.cut, len(ends))

    def where(members: Bools) -> Bools:
        beside = members & (surface & ~cut)[: len(members)]
        return surface if beside.any() or not (members & cut[: len(members)]).any() else cut

    return {name: inherited(members, ends, where(members)) for name, members in sets.items()}


def inherited(members: Bools, ends: Int32s, surface: Bools) -> Bools:
    """A set of nodes once there are midpoints.

    A midpoint is in it if both ends of its edge are; of a set of nodes of the surface only if the edge lies on the
    surface too. `members` (n,), `ends` (n', 2) as of `refined`, `surface` (n',): nodes and midpoints of the boundary.
    """
    both = members[ends].all(axis=1)
    inside = members & ~surface[: len(members)]
    return np.asarray(both if inside.any() else both & surface)


def _octahedra(points: Floats, nodes: Ints) -> Int32s:
    """The four tetrahedra (m, 4, 4) about the shortest diagonal of each octahedron, positively oriented."""
    ends = points[nodes[:, _DIAGONALS]]
    shortest = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2).argmin(axis=1)
    every = np.arange(len(nodes))[:, None]
    diagonal = nodes[every, _DIAGONALS[shortest]]
    ring = nodes[every, _RINGS[shortest]]
    tetrahedra = np.stack([ring, np.roll(ring, -1, axis=1)], axis=2)
    tetrahedra = np.concatenate([np.repeat(diagonal[:, None], 4, axis=1), tetrahedra], axis=2)
    edges = points[tetrahedra[:, :, 1:]] - points[tetrahedra[:, :, :1]]
    inverted = np.linalg.det(edges) < 0.0
    tetrahedra[inverted] = tetrahedra[inverted][:, [1, 0, 2, 3]]
    return np.asarray(tetrahedra, dtype=np.int32)
