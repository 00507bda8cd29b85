"""`TetMesh`: points, tetrahedra, tissue labels and named sets, checked once when made."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpbrain.arrays import Bools, Floats, Int32s
from warpbrain.errors import InputError
from warpbrain.mesh.surface import EDGES, FACES, boundary_faces, in_rows, interface_faces

#: What is kept of that which is made of a mesh's elements again and again.
_KEPT = 6
#: A coordinate [m] beyond this is no place.
LARGEST = 1e12


class MeshError(InputError):
    """A mesh that cannot be computed with; the message is one line that says what is wrong and where.

    Attributes
    ----------
    messages : tuple of str
        Everything that is wrong, of which the message is the first.
    """

    def __init__(self, *messages: str) -> None:
        super().__init__(messages[0])
        self.messages = messages

    def within(self, place: str) -> MeshError:
        """The same error, said of a place."""
        return MeshError(*(f"{place}: {message}" for message in self.messages))


def _ids(mask_or_ids: ArrayLike, limit: int = 5) -> str:
    """First few ids as text, for an error message: ``"3, 7, 12, ... (41 in all)"``."""
    ids = np.asarray(mask_or_ids)
    if ids.dtype == bool:
        ids = np.flatnonzero(ids)
    text = ", ".join(str(int(i)) for i in ids[:limit])
    return f"{text}, ... ({len(ids)} in all)" if len(ids) > limit else text


def _integers(values: ArrayLike, what: str) -> Int32s:
    """`values` as int32; floats are accepted only where they are whole numbers."""
    array = np.asarray(values)
    if array.dtype == bool or not (np.issubdtype(array.dtype, np.integer) or np.issubdtype(array.dtype, np.floating)):
        raise MeshError(f"{what} must be integers, found {array.dtype}")
    with np.errstate(invalid="ignore"):
        whole = array.astype(np.int32)
    if not np.array_equal(whole, array):
        raise MeshError(f"{what} must be whole numbers that fit 32 bits, found {array[whole != array].ravel()[0]}")
    return whole


def _by_name(given: Mapping[str, ArrayLike], what: str, shape: tuple[int, ...]) -> Mapping[str, Any]:
    """Copies that cannot be written to, of sets (booleans) or of vectors (real numbers), by name.

    `MeshError` if one has another shape, or a set is not boolean. `what`: for its message.
    """
    checked, is_set = {}, len(shape) == 1
    for name, values in given.items():
        array = np.asarray(values, dtype=None if is_set else np.float64)
        if is_set and array.dtype != bool:
            raise MeshError(f"{what} '{name}' must be a boolean array, found {array.dtype}")
        if array.shape != shape:
            raise MeshError(f"{what} '{name}' {'has' if is_set else 'have'} shape {array.shape}, expected {shape}")
        checked[name] = _frozen(array)
    return MappingProxyType(checked)


def _frozen(array: NDArray[Any]) -> NDArray[Any]:
    """A contiguous copy that refuses writing: a checked mesh stays what was checked."""
    copy = np.array(array, order="C", copy=True)
    copy.setflags(write=False)
    return copy


@dataclass(frozen=True, eq=False)
class TetMesh:
    """A body made of linear tetrahedra.

    Parameters
    ----------
    points : (n, 3) array
        Node positions [m], axes RAS (x right, y anterior, z superior).
    tetrahedra : (m, 4) array
        Node ids of each tetrahedron, positively oriented: ``(p1 - p0) x (p2 - p0) . (p3 - p0) > 0``.
    tissue : (m,) array, optional
        Integer label of each tetrahedron; one everywhere if left out.
    node_sets : mapping of str to (n,) bool array
        Named sets of nodes.
    element_sets : mapping of str to (m,) bool array
        Named sets of tetrahedra.
    element_vectors : mapping of str to (m, 3) array
        Named vectors of tetrahedra, such as directions of fibres; what is not known may be zero or not finite.
    cut : (k, 3) array
        Triangles of the boundary, oriented outwards, that were inside until tetrahedra were taken out; see `without`.

    Raises
    ------
    MeshError
        If anything above does not hold, a coordinate is not finite, or a node is used by no tetrahedron.

    Examples
    --------
    >>> mesh = TetMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]])
    >>> round(mesh.volume, 6)
    0.166667
    """

    points: Floats
    tetrahedra: Int32s
    tissue: Int32s = None  # type: ignore[assignment]  # filled in below
    node_sets: Mapping[str, Bools] = field(default_factory=dict)
    element_sets: Mapping[str, Bools] = field(default_factory=dict)
    element_vectors: Mapping[str, Floats] = field(default_factory=dict)
    cut: Int32s = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int32))

    def __post_init__(self) -> None:
        points = np.asarray(self.points, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 3:
            raise MeshError(f"points must have shape (n, 3), found {points.shape}")
        tetrahedra = _integers(self.tetrahedra, "tetrahedra")
        if tetrahedra.size == 0:
            raise MeshError("the mesh is empty: it has no tetrahedra")
        if tetrahedra.ndim != 2 or tetrahedra.shape[1] != 4:
            raise MeshError(f"tetrahedra must have shape (m, 4), found {tetrahedra.shape}")
        count = len(tetrahedra)
        tissue = np.ones(count, dtype=np.int32) if self.tissue is None else _integers(self.tissue, "tissue labels")
        if tissue.shape != (count,):
            raise MeshError(f"tissue has shape {tissue.shape}, expected one label a tetrahedron: ({count},)")
        if defects := _defects(points, tetrahedra):
            raise MeshError(*defects)
        for name, value in {
            "points": _frozen(points),
            "tetrahedra": _frozen(tetrahedra),
            "tissue": _frozen(tissue),
            "node_sets": _by_name(self.node_sets, "node set", (len(points),)),
            "element_sets": _by_name(self.element_sets, "element set", (count,)),
            "element_vectors": _by_name(self.element_vectors, "element vectors", (count, 3)),
            "cut": _frozen(_integers(self.cut, "triangles of a cut")),
        }.items():
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        labels = ", ".join(map(str, self.labels))
        return (
            f"TetMesh({len(self.points)} nodes, {len(self.tetrahedra)} tetrahedra, {self.volume:.6g} m3, "
            f"tissue {labels}, node sets {sorted(self.node_sets)}, element sets {sorted(self.element_sets)})"
        )

    def __reduce__(self) -> tuple[Any, ...]:
        # a mapping proxy cannot be pickled, and meshes travel to worker processes
        named = (dict(self.node_sets), dict(self.element_sets), dict(self.element_vectors))
        return (TetMesh, (self.points, self.tetrahedra, self.tissue, *named, self.cut))

    @cached_property
    def labels(self) -> tuple[int, ...]:
        """Labels of the tissues that there are, increasing; found once."""
        return tuple(np.unique(self.tissue).tolist())

    @cached_property
    def volumes(self) -> Floats:
        """Volume of each tetrahedron [m3], shape (m,)."""
        return signed_volumes(self.points, self.tetrahedra)

    @cached_property
    def centres(self) -> Floats:
        """Middle of each tetrahedron [m], shape (m, 3)."""
        return np.asarray(self.points[self.tetrahedra].mean(axis=1))

    @cached_property
    def boundary(self) -> Int32s:
        """Triangles (b, 3) of the boundary, oriented outwards; found once."""
        return boundary_faces(self.tetrahedra)

    @cached_property
    def shared(self) -> dict[str, Any]:
        """What was made of its elements, of all meshes alike that differ from it in their node sets only."""
        return {}

    def made_once(self, key: Hashable, make: Callable[[], NDArray[Any]]) -> Any:
        """What is made of its elements, not to be written to, of which the last few are kept (`shared`).

        States of a body under other hypotheses, and those on its finer mesh, ask for the same again and again.
        """
        kept = self.shared.setdefault("made once", {})
        if (found := kept.get(key)) is None:
            for earliest in list(kept)[: max(len(kept) + 1 - _KEPT, 0)]:
                kept.pop(earliest, None)
            found = kept[key] = make()
            found.flags.writeable = False
        return found

    def with_node_sets(self, sets: Mapping[str, ArrayLike]) -> TetMesh:
        """The same mesh with other sets of nodes: only these are checked, and nothing that is known is made again.

        Raises
        ------
        MeshError
            If a set is not a boolean array of one value a node.
        """
        checked = _by_name(sets, "node set", (len(self.points),))
        other: TetMesh = object.__new__(TetMesh)
        other.__dict__.update({"shared": self.shared, **vars(self)}, node_sets=checked)
        return other

    def is_as(self, other: TetMesh) -> bool:
        """Whether another mesh is this one, or was made of the same by `with_node_sets` and has the same sets."""
        if self is other:
            return True
        sets, others = self.node_sets, other.node_sets
        return (
            self.shared is other.shared
            and sets.keys() == others.keys()
            and all(sets[name] is others[name] or np.array_equal(sets[name], others[name]) for name in sets)
        )

    @property
    def volume(self) -> float:
        """Volume of the body [m3]."""
        return float(self.volumes.sum())

    @property
    def radius(self) -> float:
        """Of the sphere of that volume [m]: how large the body is, 65 mm of a brain of 1150 cm3."""
        return float(np.cbrt(0.75 * self.volume / np.pi))

    @cached_property
    def node_volumes(self) -> Floats:
        """Volume lumped to each node [m3], a quarter of each of its tetrahedra, shape (n,)."""
        return self.lumped(self.volumes)

    def lumped(self, amounts: ArrayLike) -> Floats:
        """Amounts (m,) of the tetrahedra shared evenly by their nodes, shape (n,)."""
        quarters = np.repeat(np.asarray(amounts, dtype=np.float64) / 4.0, 4)
        lumped = np.bincount(self.tetrahedra.ravel(), weights=quarters, minlength=len(self.points))
        return lumped.astype(np.float64)

    def without(self, elements: ArrayLike) -> tuple[TetMesh, Int32s, Int32s]:
        """The mesh that is left when some tetrahedra are removed.

        Parameters
        ----------
        elements : (m,) bool array
            True for the tetrahedra to remove.

        Returns
        -------
        mesh : TetMesh
            What remains; nodes that belonged to removed tetrahedra only are gone; sets and vectors are restricted. The
            faces that it shared with what was removed are its `cut`, with those of an earlier one that are left.
        node_ids : (n',) int32 array
            Id in this mesh of every node of the new one.
        element_ids : (m',) int32 array
            Id in this mesh of every tetrahedron of the new one.
        """
        removed = np.asarray(elements)
        if removed.dtype != bool or removed.shape != (len(self.tetrahedra),):
            raise MeshError(
                f"elements to remove must be a boolean array of shape ({len(self.tetrahedra)},), "
                f"found {removed.dtype} {removed.shape}"
            )
        if removed.all():
            raise MeshError("removing every tetrahedron leaves no mesh")
        # hypotheses about one body take the same part out again and again
        removed_bytes = removed.tobytes()
        if self.shared.get("taken out") != removed_bytes:
            self.shared["taken out"], self.shared["left"] = removed_bytes, (self.node_sets, *self._left(~removed))
        sets, mesh, node_ids, element_ids = self.shared["left"]
        if self.node_sets is not sets:
            mesh = mesh.with_node_sets({name: members[node_ids] for name, members in self.node_sets.items()})
            # the next one has the same sets: what is known of what is left by being that mesh stays known
            self.shared["left"] = self.node_sets, mesh, node_ids, element_ids
        return mesh, node_ids, element_ids

    def _named(self, nodes: Any, elements: Any) -> tuple[dict[str, Bools], dict[str, Bools], dict[str, Floats]]:
        """Sets and vectors of some nodes and elements, by their ids."""
        return (
            {name: members[nodes] for name, members in self.node_sets.items()},
            {name: members[elements] for name, members in self.element_sets.items()},
            {name: vectors[elements] for name, vectors in self.element_vectors.items()},
        )

    def _left(self, kept: Bools) -> tuple[TetMesh, Int32s, Int32s]:
        element_ids = np.flatnonzero(kept).astype(np.int32)
        tetrahedra = self.tetrahedra[element_ids]
        node_ids = np.unique(tetrahedra).astype(np.int32)
        new_id = np.full(len(self.points), -1, dtype=np.int32)
        new_id[node_ids] = np.arange(len(node_ids), dtype=np.int32)
        # faces that a removed tetrahedron had of an earlier cut have no other owner
        gone = self.tetrahedra[~kept][:, FACES].reshape(-1, 3)
        earlier = self.cut[~in_rows(self.cut, gone)]
        cut = new_id[np.concatenate([interface_faces(self.tetrahedra, ~kept), earlier])]
        named = self._named(node_ids, element_ids)
        mesh = TetMesh(self.points[node_ids], new_id[tetrahedra], self.tissue[element_ids], *named, cut)
        # of all who ask
        node_ids.setflags(write=False)
        element_ids.setflags(write=False)
        return mesh, node_ids, element_ids


def signed_volumes(points: ArrayLike, tetrahedra: ArrayLike) -> Floats:
    """Signed volume of tetrahedra, in the cube of the unit of `points`.

    `points` (n, 3): node positions. `tetrahedra` (m, 4): node ids. Returns (m,): positive where the tetrahedron is
    positively oriented.
    """
    corner = np.asarray(points, dtype=np.float64)[np.asarray(tetrahedra)]
    a, b, c = (corner[:, i] - corner[:, 0] for i in (1, 2, 3))
    return np.asarray(np.einsum("ij,ij->i", np.cross(a, b), c) / 6.0)


def _defects(points: Floats, tetrahedra: Int32s) -> list[str]:
    """Everything that makes points and tetrahedra no body, one line each."""
    defects = []
    bad = np.asarray(~(np.abs(points) <= LARGEST).all(axis=1))
    if bad.any():
        defects.append(f"{bad.sum()} node(s) with a coordinate that is not finite: node {_ids(bad)}")
    count = len(points)
    outside = ((tetrahedra < 0) | (tetrahedra >= count)).any(axis=1)
    if outside.any():
        first = int(np.flatnonzero(outside)[0])
        defects.append(
            f"{outside.sum()} tetrahedra name a node that does not exist (nodes are 0 to {count - 1}): "
            f"tetrahedron {_ids(outside)}; the first has nodes {tetrahedra[first].tolist()}"
        )
    ordered = np.sort(tetrahedra, axis=1)
    repeated = (ordered[:, 1:] == ordered[:, :-1]).any(axis=1)
    if repeated.any():
        defects.append(f"{repeated.sum()} tetrahedra name a node twice: tetrahedron {_ids(repeated)}")
    unused = np.bincount(tetrahedra[~outside].ravel(), minlength=count) == 0
    if unused.any():
        defects.append(f"{unused.sum()} node(s) belong to no tetrahedron: node {_ids(unused)}; take them out")
    whole = np.flatnonzero(~outside & ~repeated)
    corner = points[tetrahedra[whole]]
    measurable = ~bad[tetrahedra[whole]].any(axis=1)
    with np.errstate(invalid="ignore", over="ignore"):
        volumes = signed_volumes(points, tetrahedra[whole])
        longest = np.sqrt(((corner[:, EDGES[:, 0]] - corner[:, EDGES[:, 1]]) ** 2).sum(-1).max(axis=1))
        # flat to rounding: such a volume has no sign that means anything
        flat = measurable & (np.abs(volumes) <= 1e-12 * longest**3)
        inverted = measurable & ~flat & (volumes < 0)
    if flat.any():
        defects.append(f"{flat.sum()} tetrahedra have zero volume: tetrahedron {_ids(whole[flat])}")
    if inverted.any():
        defects.append(
            f"{inverted.sum()} tetrahedra are inverted (negative volume): tetrahedron {_ids(whole[inverted])}; "
            "swap two nodes of each"
        )
    return defects


def ordered(mesh: TetMesh) -> TetMesh:
    """The same mesh with nodes in reverse Cuthill-McKee order and tetrahedra sorted by their nodes.

    Meshers number as they go. In this order the entries that an element or a matrix row touches lie close together,
    which saves a fifth of the time of assembly (`docs/benchmarks.md`).
    """
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    count = len(mesh.points)
    rows = np.repeat(mesh.tetrahedra, 4, axis=1).ravel()
    columns = np.tile(mesh.tetrahedra, (1, 4)).ravel()
    graph = csr_matrix((np.ones(len(rows), dtype=np.int8), (rows, columns)), shape=(count, count))
    nodes = np.asarray(reverse_cuthill_mckee(graph, symmetric_mode=True))
    number = np.empty(count, dtype=np.int64)
    number[nodes] = np.arange(count)
    tetrahedra = number[mesh.tetrahedra].astype(np.int32)
    elements = np.lexsort(np.sort(tetrahedra, axis=1).T[::-1])
    return TetMesh(mesh.points[nodes], tetrahedra[elements], mesh.tissue[elements], *mesh._named(nodes, elements))
