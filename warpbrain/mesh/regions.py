"""What a mesh file says of its tissues and sets in the ways of other programs, without being asked for one of them.

* Tissues: a whole-number array of the cells (VTK, XDMF, Medit), the physical groups of Gmsh, or sets of elements
  (Abaqus' ``*ELSET``) of which every tetrahedron is in one and in no other: those that ``*SOLID SECTION`` gives a
  material, else all there are, else those of ``*ELEMENT`` lines.
* Node sets: the nodes of groups of faces, edges and points (Gmsh, ``*ELSET`` of shells), ``*NSET``, and each value of a
  whole-number array of the points.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Bools, Ints
from warpbrain.mesh.abaqus import MATERIAL_SETS
from warpbrain.mesh.files import ELEMENT_SET_PREFIX, TETRAHEDRA, ends_inside_a_number, mesh_in_file, read_raw
from warpbrain.mesh.tet_mesh import MeshError, TetMesh

#: Array that is made of sets of elements, and what `--array` calls them.
SETS = "sets"
#: Values of an array that could be tissues, or markers of points; more are numbers of elements, materials points, ...
MOST_VALUES = 256
#: What Gmsh numbers besides physical groups, and what VTK counts: no tissues unless they are asked for.
_BOOKKEEPING = re.compile(r"gmsh:geometrical|gmsh:dim_tags|vtk\w+|Global\w*Ids?|Ids?|rank|partition\w*", re.IGNORECASE)
_PHYSICAL = "gmsh:physical"
_DIMENSION = {"vertex": 0, "line": 1, "line3": 1}


@dataclass(frozen=True, eq=False)
class MeshWithRegions:
    """A mesh with what its file names."""

    mesh: TetMesh
    names: dict[int, str]  # names of tissues that the file has
    notes: tuple[str, ...]  # where tissues and sets are from


def read_regions(path: Path, unit: str, array: str | None = None) -> MeshWithRegions:
    """Read a mesh with its tissues and sets.

    `unit` ("m" or "mm"): of its coordinates. `array`: cell array of the tissues, or `SETS`; by default ``tissue`` if
    there is one, else the only one that can be it. `MeshError`, naming the file, if it is no mesh, or several arrays
    could be the tissues; the message lists them.
    """
    raw = read_raw(path)
    if not any(block.type in TETRAHEDRA for block in raw.cells):
        return MeshWithRegions(mesh_in_file(path, raw, unit).mesh, {}, ())
    notes: list[str] = []
    if ends_inside_a_number(path):
        notes.append(f"{path.name} ends in a number without a line break: is it cut off?")
    # physical groups of Gmsh: tag and dimension
    groups = {name: value for name, value in (raw.field_data or {}).items() if np.shape(value) == (2,)}
    physical = {(int(dim), int(tag)): name for name, (tag, dim) in groups.items()}
    others = [name for name in raw.cell_sets or {} if name not in groups and not name.startswith("gmsh:")]
    sets = {name: _members(raw, name) for name in others}
    of_tetrahedra = {name: _of_tetrahedra(raw, members) for name, members in sets.items()}
    parts = _partition(of_tetrahedra, *(raw.info or {}).get(MATERIAL_SETS, ([], [])))
    if parts:
        numbered = list(enumerate(parts, 1))
        raw.cell_data[SETS] = [
            np.sum([number * sets[name][block] for number, name in numbered], axis=0) for block in range(len(raw.cells))
        ]
    chosen = _chosen(path, raw, array)
    names: dict[int, str] = {}
    if chosen == SETS and parts:
        names = dict(numbered)
        notes.append(f"tissues are the sets of elements {', '.join(parts)}")
    elif chosen is not None:
        values = np.unique(_of_tetrahedra(raw, raw.cell_data[chosen]))
        names = {int(v): physical[3, int(v)] for v in values if chosen == _PHYSICAL and (3, int(v)) in physical}
        if chosen != "tissue":
            what = "physical groups of Gmsh" if chosen == _PHYSICAL else f"values of the cell array '{chosen}'"
            notes.append(f"tissues are the {what}: {', '.join(names.get(int(v), str(int(v))) for v in values)}")
    elif counts := {name: int(members.sum()) for name, members in of_tetrahedra.items() if members.any()}:
        listed = ", ".join(f"{name} ({count} tetrahedra)" for name, count in counts.items())
        notes.append(f"sets of elements that overlap or leave some out are no tissues: {listed}")
    notes += _name_nodes(raw, sets, None if chosen == SETS else chosen, physical)
    for name, members in of_tetrahedra.items():
        if members.any() and not (chosen == SETS and name in parts):
            raw.cell_data[ELEMENT_SET_PREFIX + _plain(name)] = [each.astype(np.uint8) for each in sets[name]]
    if chosen is not None and chosen != "tissue":
        raw.cell_data["tissue"] = raw.cell_data[chosen]
    raw.cell_data.pop(SETS, None)
    return MeshWithRegions(mesh_in_file(path, raw, unit).mesh, names, tuple(notes))


def _of_tetrahedra(raw: Any, of_blocks: Sequence[Any]) -> NDArray[Any]:
    """Values (m, ...) of the tetrahedra alone, of those of all cells, which are given block by block."""
    pairs = zip(raw.cells, of_blocks, strict=True)
    return np.concatenate([np.asarray(values) for block, values in pairs if block.type in TETRAHEDRA])


def _whole(values: NDArray[Any]) -> Ints | None:
    """Values (n,) as whole numbers, None if they are not."""
    if values.ndim == 2 and values.shape[1] == 1:
        values = values[:, 0]
    if values.ndim != 1 or values.dtype.kind not in "biuf":
        return None
    if values.dtype.kind == "f" and not (np.abs(values) < 2**31).all():
        return None
    whole = values.astype(np.int64)
    return whole if (whole == values).all() else None


def _chosen(path: Path, raw: Any, array: str | None) -> str | None:
    """Name of the cell array of the tissues; None if there is none."""
    if array is not None:
        if array not in raw.cell_data:
            names = ", ".join(sorted(raw.cell_data)) or "none"
            raise MeshError(f"{path}: no cell array '{array}' for tissue labels; found {names}")
        return array
    if "tissue" in raw.cell_data:
        return "tissue"
    values: dict[str, int] = {}
    for name in raw.cell_data:
        whole = _whole(_of_tetrahedra(raw, raw.cell_data[name]))
        if name.startswith(ELEMENT_SET_PREFIX) or _BOOKKEEPING.fullmatch(name) or whole is None or not len(whole):
            continue
        distinct = np.unique(whole)
        if distinct[0] >= 0 and len(distinct) <= min(MOST_VALUES, max(1, len(whole) // 2)):
            values[name] = len(distinct)
    # an array that says one thing of all tetrahedra is a choice only if none says more
    several = [name for name in values if values[name] > 1] or list(values)
    if len(several) > 1 and max(values.values()) > 1:
        listed = ", ".join(f"{name} ({values[name]} values)" for name in sorted(several))
        raise MeshError(
            f"{path}: found {len(several)} cell arrays that could be the tissues: {listed}: --array says which"
        )
    return several[0] if len(several) == 1 else None


def _partition(members: Mapping[str, Bools], sections: Sequence[str], of_elements: Sequence[str]) -> list[str]:
    """Sets of elements of which every tetrahedron is in one, and in one only; none if there are none such."""
    for names in (sections, list(members), of_elements):
        parts = [name for name in names if members[name].any() and not members[name].all()]
        # one set of all, if it is the only one
        parts = parts or [name for name in names if members[name].all()]
        if parts and (np.sum([members[name] for name in parts], axis=0) == 1).all():
            return parts
    return []


def _members(raw: Any, name: str) -> list[Bools]:
    """For each block which cells are in a set."""
    all_members = []
    for block, ids in zip(raw.cells, raw.cell_sets[name], strict=True):
        members = np.zeros(len(block.data), dtype=bool)
        if ids is not None and len(ids):
            members[np.asarray(ids, dtype=np.int64)] = True
        all_members.append(members)
    return all_members


def _name_nodes(
    raw: Any, sets: Mapping[str, list[Bools]], chosen: str | None, physical: Mapping[tuple[int, int], str]
) -> list[str]:
    """Add node sets of faces, edges and points, and of the values of point arrays; says which."""
    added: dict[str, list[Ints]] = {}
    for number, block in enumerate(raw.cells):
        if block.type in TETRAHEDRA:
            continue
        dimension = _DIMENSION.get(block.type, 2)
        labels = _whole(np.asarray(raw.cell_data[chosen][number])) if chosen in raw.cell_data else None
        if labels is not None and len(values := np.unique(labels[labels != 0])) <= MOST_VALUES:
            for value in values.tolist():
                name = physical.get((dimension, value), f"{str(chosen).removeprefix('gmsh:')}-{value}")
                added.setdefault(name, []).append(block.data[labels == value].ravel())
        for name, members in sets.items():
            if members[number].any():
                added.setdefault(name, []).append(block.data[members[number]].ravel())
    notes = []
    for name, values_at in list(raw.point_data.items()):
        whole = _whole(np.asarray(values_at))
        if whole is None:
            continue
        marks = np.unique(whole[whole != 0])
        if len(marks) > MOST_VALUES or _BOOKKEEPING.fullmatch(name):
            notes.append(f"point array '{name}' has {len(marks)} values: no node sets are made of it")
            raw.point_data.pop(name)
        elif len(marks) == 1 and whole.all():
            # the same of every node, as Medit's numbers are that nobody has given
            raw.point_data.pop(name)
        elif len(marks) > 1:
            raw.point_data.pop(name)
            for mark in marks:
                added.setdefault(f"{name}-{mark}", []).append(np.flatnonzero(whole == mark))
    named = {_plain(name): ids for name, ids in (raw.point_sets or {}).items()}
    for name, pieces in added.items():
        free = _plain(name)
        while free in named or free in raw.point_data:
            free += "-faces"
        named[free] = np.unique(np.concatenate(pieces))
    raw.point_sets = named
    if added:
        listed = ", ".join(_plain(name) for name in added)
        notes.append(f"node sets from groups of faces or values of points: {listed}")
    return notes


def _plain(name: str) -> str:
    """A name that case.toml and VTU files can hold."""
    return re.sub(r"[^\w .+-]+", "-", name).strip() or "unnamed"
