"""The free surfaces of a case by name: node sets that it declares, and sets made for the others.

Something may act on every connected surface that nothing holds, whether a case declares a node set for it or not. A
surface without a set gets one, so that a `case.toml` can refer to it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from warpbrain.arrays import Bools, Int32s
from warpbrain.cases.case import Case
from warpbrain.inference.beliefs import belief
from warpbrain.mesh import TetMesh, faces_of, nodes_of, split_boundary
from warpbrain.mesh.free_surfaces import FreePart, FreeSurface, free_faces, free_parts, rim_corners
from warpbrain.mesh.surface import in_rows
from warpbrain.physics.words import name_of_set

#: Names of the wall that a resection leaves, and of the outside.
WALL, OUTSIDE = "wall of the cavity", "outer surface"
#: Names of the lower and the upper end of each axis (RAS).
_SIDES = (("left", "right"), ("back", "front"), ("lower", "upper"))
#: Words in the names of a brain's tissues: a void within it is a ventricle.
_OF_BRAIN = ("matter", "brain", "cortex", "cerebr")


def held_nodes(case: Case) -> Bools:
    """Nodes (n,) of what is left of a body that cannot move freely: held, moved, or kept to a wall."""
    mesh, _ = case.remaining
    held = np.zeros(len(mesh.points), dtype=bool)
    for boundary in case.boundaries:
        if boundary.holds:
            held |= mesh.node_sets[boundary.nodes]
    for mechanism in case.mechanisms:
        held[mechanism.held(mesh)[0]] = True
    return held


def free_surfaces(case: Case) -> tuple[FreeSurface, ...]:
    """Every free surface of a case, each once: the node sets that it declares, then connected parts that are no set.

    A node set is a place where it has triangles of the surface that are not held and no boundary uses it. Where a set
    and a part have the same triangles, that set stands for it, or that boundary.
    """
    mesh, _ = case.remaining
    held = held_nodes(case)
    # a set of the nodes of a part holds its triangles, and beside these some of only such nodes
    parts = [(words, nodes_of(part.faces, len(mesh.points)), part.origin) for words, part in _named_parts(case)]
    used = {boundary.nodes for boundary in case.boundaries}
    corners = rim_corners(mesh)
    known = {_triangles_key(free_faces(mesh, mesh.node_sets[name], held), corners) for name in used}
    walls = {
        _triangles_key(free_faces(mesh, members, held), corners): words
        for words, members, origin in parts
        if origin == "cut"
    }
    surfaces: list[FreeSurface] = []

    def add(name: str, words: str, members: Bools) -> None:
        faces = free_faces(mesh, members, held)
        key = _triangles_key(faces, corners)
        if len(faces) and key not in known:
            known.add(key)
            surfaces.append(FreeSurface(name, walls.get(key, words), members, faces))

    for name, members in mesh.node_sets.items():
        if name not in used:
            add(name, name_of_set(name), members)
    if case.resection is not None and case.resection.elements not in mesh.node_sets:
        # a mechanism may name the wall by the element set already
        add(case.resection.elements, WALL, nodes_of(mesh.cut, len(mesh.points)))
    names = {*mesh.node_sets, *mesh.element_sets}
    for words, members, _ in parts:
        name = _unused(words.replace(" ", "-"), names)
        names.add(name)
        add(name, words, members)
    return tuple(surfaces)


def unused_edges(case: Case) -> tuple[str, ...]:
    """Node sets of the surface without a face, edges and points, that a case declares and nothing in it names.

    Those with faces are surfaces: `free_surfaces`.
    """
    mesh, _ = case.remaining
    free = nodes_of(mesh.boundary, len(mesh.points)) & ~held_nodes(case)
    used = _named_sets(case)
    return tuple(
        name
        for name, members in mesh.node_sets.items()
        if name not in used and members.any() and not (members & ~free).any() and not len(faces_of(mesh, members))
    )


def named_triangles(case: Case, surfaces: Sequence[FreeSurface]) -> tuple[tuple[str, Int32s], ...]:
    """Triangles (k, 3) that can move with what people call them: connected parts, and free surfaces, each of them."""
    parts = [(words, part.faces) for words, part in _named_parts(case)]
    return (*parts, *((surface.words, surface.faces) for surface in surfaces))


def connected_parts(case: Case) -> list[FreePart]:
    """The connected free surfaces of what is left of a body, whatever node sets there are: no triangle is in two."""
    mesh, nodes = case.remaining
    _, voids = split_boundary(case.mesh.points, case.mesh.tetrahedra)
    inner = nodes_of(np.concatenate([np.zeros((0, 3), dtype=np.int32), *voids]), len(case.mesh.points))
    return free_parts(mesh, held_nodes(case), inner[nodes], belief("surfaces.smallest"))


def with_free_surfaces(case: Case, surfaces: Sequence[FreeSurface] | None = None) -> Case:
    """The same case with a node set for each of its free surfaces, which are found if they are not given."""
    _, nodes = case.remaining
    sets = dict(case.mesh.node_sets)
    for surface in free_surfaces(case) if surfaces is None else surfaces:
        if surface.name not in sets:
            sets[surface.name] = np.zeros(len(case.mesh.points), dtype=bool)
            sets[surface.name][nodes] = surface.members
    return replace(case, mesh=case.mesh.with_node_sets(sets))


def with_sets_that_act(case: Case, declared: TetMesh) -> Case:
    """The same case without node sets that a mesh does not declare and nothing in the case names."""
    named = _named_sets(case)
    sets, declared_sets = case.mesh.node_sets.items(), declared.node_sets
    kept = {name: members for name, members in sets if name in declared_sets or name in named}
    return replace(case, mesh=case.mesh.with_node_sets(kept))


def _named_sets(case: Case) -> set[str]:
    """Node sets on which a case declares a boundary or a mechanism."""
    named = {boundary.nodes for boundary in case.boundaries}
    for mechanism in case.mechanisms:
        kinds = mechanism.parameters().items()
        named |= {getattr(mechanism, name) for name, spec in kinds if spec.kind == "node set"}
    return named


def _triangles_key(faces: Int32s, corners: Int32s) -> bytes:
    """A key that is equal for equal triangles, those with corners of a cut left out."""
    inner = faces[~in_rows(faces, corners)]
    rows = np.sort(inner if len(inner) else faces, axis=1)
    return rows[np.lexsort(rows.T)].tobytes()


def _named_parts(case: Case) -> Iterator[tuple[str, FreePart]]:
    """Connected parts with their names: those of the same kind are told apart by where they are."""
    parts, inside = connected_parts(case), np.zeros(len(case.remaining[0].points), dtype=bool)
    for part in parts:
        if part.origin == "inner":
            inside[part.faces] = True
    by_word: dict[str, list[FreePart]] = {}
    for part in parts:
        by_word.setdefault(_name_of(case, part, inside), []).append(part)
    for word, of_word in by_word.items():
        centres = np.array([part.centre for part in of_word])
        axis = int(np.ptp(centres, axis=0).argmax())
        for rank, number in enumerate(np.argsort(centres[:, axis]).tolist()):
            yield _with_side(word, _SIDES[axis], rank, len(of_word)), of_word[number]


def _with_side(word: str, sides: tuple[str, str], rank: int, count: int) -> str:
    """The name of one of several parts of a kind, in their order along an axis."""
    if count == 1:
        return word
    before, _, after = word.partition(" of ")
    end = sides[0] if rank == 0 else sides[1] if rank == count - 1 else "middle"
    number = f" {rank}" if 0 < rank < count - 1 and count > 3 else ""
    return f"{end} {before}{f' of {after}' if after else ''}{number}"


def _name_of(case: Case, part: FreePart, inside: Bools) -> str:
    """The name of a part of a kind; of a void that of the node set that it is a part of, if there is one."""
    if part.origin != "inner":
        return WALL if part.origin == "cut" else OUTSIDE
    mesh, _ = case.remaining
    outside = nodes_of(mesh.boundary, len(inside)) & ~inside
    for name, members in mesh.node_sets.items():
        if members[part.faces].all() and not (members & outside).any():
            return name_of_set(name)
    of_brain = any(word in f"{t.name} {t.prior}".lower() for t in case.tissues.values() for word in _OF_BRAIN)
    return "ventricle" if of_brain else "wall of the void"


def _unused(name: str, names: set[str]) -> str:
    """A name that is not yet used."""
    number, candidate = 1, name
    while candidate in names:
        number += 1
        candidate = f"{name}-{number}"
    return candidate
