"""What is made once for a mesh on a device, and read by every system of it: elements, and patterns of matrices."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpbrain.arrays import Floats, Int32s
from warpbrain.kernels.module import Precision
from warpbrain.mesh import TetMesh

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Pattern:
    """Pattern of a symmetric block matrix over nodes, and the lists that fill it: of NumPy, or on a device.

    What acts is a number of families of stencils: the four nodes of every tetrahedron, the three of every triangle that
    a pressure acts on. A stencil of s nodes has s forces and s (s + 1) / 2 blocks, those of its node pairs (a, b),
    a <= b, row by row. Forces and blocks of all families lie one after the other in one array each.
    """

    offsets: Any  # start of each block row in `columns`
    columns: Any  # block column of each stored block, ascending within a row
    diagonal: Any  # position of each diagonal block
    block_pairs: Any  # pair whose block is stored there, or -1 - pair where its transpose is
    pairs: Any  # node pairs i <= j that share a stencil
    positions: Any  # positions of the blocks (i, j) and (j, i) of each pair
    first: Any  # start of each pair's list in `contributions`
    contributions: Any  # stencil blocks that add up to the pair's block, ascending
    corner_first: Any  # start of each node's list in `corners`
    corners: Any  # stencil forces on the node, ascending


def build_pattern(stencils: Sequence[NDArray[np.integer]], count: int) -> Pattern:
    """Make the pattern of families of stencils over `count` nodes, each of which is in a stencil.

    Node ids (k, s) ascend in each row, so that every block of a pair (a, b), a <= b, belongs to nodes i <= j.
    """
    keys = []
    for nodes in stencils:
        a, b = np.triu_indices(nodes.shape[1])
        keys.append((nodes[:, a].astype(np.int64) * count + nodes[:, b]).ravel())
    key = np.concatenate(keys)
    contributions = np.argsort(key, kind="stable")
    key = key[contributions]
    first = np.flatnonzero(np.r_[True, key[1:] != key[:-1]])
    i, j = np.divmod(key[first], count)

    mirrored = np.flatnonzero(i != j)
    rows, columns = np.r_[i, j[mirrored]], np.r_[j, i[mirrored]]
    order = np.argsort(rows * count + columns, kind="stable")
    block_pairs = np.r_[np.arange(len(i)), -1 - mirrored][order]
    where = np.empty(len(order), dtype=np.int64)
    where[order] = np.arange(len(order))
    positions = np.repeat(where[: len(i), None], 2, axis=1)
    positions[mirrored, 1] = where[len(i) :]
    offsets = np.searchsorted(rows[order], np.arange(count + 1))

    all_nodes = np.concatenate([nodes.ravel() for nodes in stencils])
    corners = np.argsort(all_nodes, kind="stable")
    corner_first = np.searchsorted(all_nodes[corners], np.arange(count + 1))

    lists = {
        "offsets": offsets,
        "columns": columns[order],
        "diagonal": positions[i == j, 0],
        "block_pairs": block_pairs,
        "pairs": np.stack([i, j], axis=1),
        "positions": positions,
        "first": np.r_[first, len(key)],
        "contributions": contributions,
        "corner_first": corner_first,
        "corners": corners,
    }
    return Pattern(**{name: np.ascontiguousarray(values, dtype=np.int32) for name, values in lists.items()})


#: Of each kind of thing made of arrays, how many are kept: patterns of a finer mesh take a tenth of a gigabyte.
_KEPT = 6


class Assembly:
    """The elements of a mesh on a device, and what else no number of a model changes.

    All systems of a mesh share it: of every hypothesis, sample and sensitivity, and of specimens.
    """

    def __init__(self, mesh: TetMesh, device: wp.Device, precision: Precision) -> None:
        self._device = device
        #: Node ids (m, 4), ascending: every stored block then belongs to an upper block of the matrix. Odd permutations
        #: turn an element inside out, which nothing notices: gradients do not depend on the order, volumes are taken
        #: before it.
        self.tetrahedra: Int32s = np.sort(mesh.tetrahedra, axis=1)
        edges = mesh.points[self.tetrahedra[:, 1:]] - mesh.points[self.tetrahedra[:, :1]]
        #: Inverse edge matrices (m, 3, 3); their rows are the gradients of the shape functions of nodes 1 to 3.
        self.shape_gradients: Floats = np.linalg.inv(edges.transpose(0, 2, 1)).astype(np.float64, copy=False)
        self.nodes = wp.array(self.tetrahedra, dtype=wp.vec4i, device=device)
        self.inverse_edges = wp.array(self.shape_gradients, dtype=precision.mat33, device=device)
        self._made: dict[str, list[tuple[list[NDArray[Any]], Any]]] = {}

    @classmethod
    def of(cls, mesh: TetMesh, device: wp.Device, precision: Precision) -> Assembly:
        """That of a mesh, which meshes share that differ in their node sets only; it lives as long as one of them."""
        made, key = mesh.shared.setdefault("assemblies", {}), (device.alias, precision.name)
        if key not in made:
            made[key] = cls(mesh, device, precision)
        return made[key]

    def once(self, kind: str, arrays: Sequence[NDArray[Any]], make: Callable[[], T]) -> T:
        """What was made of the same arrays before, or is made now; the last few of a kind are kept."""
        made = self._made.setdefault(kind, [])
        for earlier, value in made:
            if len(earlier) == len(arrays) and all(map(np.array_equal, earlier, arrays)):
                return value
        value = make()
        made[:] = [*made[1 - _KEPT :], (list(arrays), value)]
        return value

    def pattern(self, stencils: Sequence[NDArray[np.integer]], count: int) -> Pattern:
        """The pattern of families of stencils over `count` nodes on the device; see `build_pattern`."""

        def make() -> Pattern:
            kinds = {"pairs": wp.vec2i, "positions": wp.vec2i}
            arrays = vars(build_pattern(stencils, count)).items()
            return Pattern(**{k: wp.array(v, dtype=kinds.get(k, int), device=self._device) for k, v in arrays})

        return self.once("pattern", [*stencils, np.array(count)], make)
