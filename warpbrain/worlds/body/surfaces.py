"""The free surfaces of a case by name: node sets that it declares, and sets made for the others.

Every connected surface that nothing holds is a place on which something may act, whether a case declares a node set for
it or not. What is said of one that has no set must be something that a `case.toml` can say: it gets a set of its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.boundary import Forced, Pressed
from warpbrain.cases.case import Case
from warpbrain.inference.beliefs import belief
from warpbrain.mesh import TetMesh, nodes_of, split_boundary
from warpbrain.mesh.free_surfaces import FreePart, FreeSurface, free_faces, free_parts, rim_corners, set_of
from warpbrain.mesh.surface import in_rows

Bools = NDArray[np.bool_]

#: What people call the wall that a resection leaves, and the outside.
WALL, OUTSIDE = "wall of the cavity", "outer surface"
#: Where in a body one of several alike is, by axis: the lower end of it, and the upper (RAS).
_SIDES = (("left", "right"), ("back", "front"), ("lower", "upper"))
#: Words in the names of a brain's tissues: a void within it is a ventricle.
_OF_BRAIN = ("matter", "brain", "cortex", "cerebr")


def held_nodes(case: Case) -> Bools:
    """Nodes (n,) of what is left of a body that cannot move freely: held, moved, or kept to a wall."""
    mesh, _ = case.remaining
    held = np.zeros(len(mesh.points), dtype=bool)
    for boundary in case.boundaries:
        if not isinstance(boundary, Forced | Pressed):
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
    parts = [(words, set_of(mesh, part), part.origin) for words, part in _called(case, connected_parts(case))]
    used = {boundary.nodes for boundary in case.boundaries}
    corners = rim_corners(mesh)
    taken = {_key(free_faces(mesh, mesh.node_sets[name], held), corners) for name in used}
    walls = {
        _key(free_faces(mesh, members, held), corners): words for words, members, origin in parts if origin == "cut"
    }
    found: list[FreeSurface] = []

    def add(name: str, words: str, members: Bools) -> None:
        faces = free_faces(mesh, members, held)
        key = _key(faces, corners)
        if len(faces) and key not in taken:
            taken.add(key)
            found.append(FreeSurface(name, walls.get(key, words), members, faces))

    for name, members in mesh.node_sets.items():
        if name not in used:
            add(name, name.replace("-", " ").replace("_", " "), members)
    if case.resection is not None and case.resection.elements not in mesh.node_sets:
        # a mechanism may name the wall by the element set already
        add(case.resection.elements, WALL, nodes_of(mesh.cut, len(mesh.points)))
    names = {*mesh.node_sets, *mesh.element_sets}
    for words, members, _ in parts:
        name = _new(words.replace(" ", "-"), names)
        names.add(name)
        add(name, words, members)
    return tuple(found)


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
    named = {boundary.nodes for boundary in case.boundaries}
    for mechanism in case.mechanisms:
        kinds = mechanism.parameters().items()
        named |= {getattr(mechanism, name) for name, says in kinds if says.kind == "node set"}
    sets, own = case.mesh.node_sets.items(), declared.node_sets
    kept = {name: members for name, members in sets if name in own or name in named}
    return replace(case, mesh=case.mesh.with_node_sets(kept))


def _key(faces: NDArray[np.int32], corners: NDArray[np.int32]) -> bytes:
    """Of the same triangles the same, whether or not they hold corners of a cut."""
    own = faces[~in_rows(faces, corners)]
    rows = np.sort(own if len(own) else faces, axis=1)
    return rows[np.lexsort(rows.T)].tobytes()


def _called(case: Case, parts: Sequence[FreePart]) -> Iterator[tuple[str, FreePart]]:
    """Parts, and what people call them: of several alike by where they are."""
    inside = np.zeros(len(case.remaining[0].points), dtype=bool)
    for part in parts:
        if part.origin == "inner":
            inside[part.faces] = True
    alike: dict[str, list[FreePart]] = {}
    for part in parts:
        alike.setdefault(_word(case, part, inside), []).append(part)
    for word, own in alike.items():
        centres = np.array([part.centre for part in own])
        axis = int(np.ptp(centres, axis=0).argmax())
        for rank, number in enumerate(np.argsort(centres[:, axis]).tolist()):
            yield _placed(word, _SIDES[axis], rank, len(own)), own[number]


def _placed(word: str, sides: tuple[str, str], rank: int, count: int) -> str:
    """A word for one of some along an axis."""
    if count == 1:
        return word
    before, _, after = word.partition(" of ")
    end = sides[0] if rank == 0 else sides[1] if rank == count - 1 else "middle"
    number = f" {rank}" if 0 < rank < count - 1 and count > 3 else ""
    return f"{end} {before}{f' of {after}' if after else ''}{number}"


def _word(case: Case, part: FreePart, inside: Bools) -> str:
    """What one of its kind is called; of a void what the set of voids is that it is a part of, if there is one."""
    if part.origin != "inner":
        return WALL if part.origin == "cut" else OUTSIDE
    mesh, _ = case.remaining
    outside = nodes_of(mesh.boundary, len(inside)) & ~inside
    for name, members in mesh.node_sets.items():
        if members[part.faces].all() and not (members & outside).any():
            return name.replace("-", " ").replace("_", " ")
    of_brain = any(word in f"{t.name} {t.prior}".lower() for t in case.tissues.values() for word in _OF_BRAIN)
    return "ventricle" if of_brain else "wall of the void"


def _new(name: str, taken: set[str]) -> str:
    """A name that nothing has."""
    number, found = 1, name
    while found in taken:
        number += 1
        found = f"{name}-{number}"
    return found
