"""What a device is told of a mesh and of a pattern: made once for each mesh, and read by every system of it.

Nothing here changes with a model's numbers, and no system writes to it. Meshes that differ in their node sets only
share it, and it lives as long as one of them does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpbrain.arrays import Floats
from warpbrain.kernels.precision import Precision
from warpbrain.mesh import TetMesh
from warpbrain.simulation.pattern import build_pattern

Ints = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class PlacedMesh:
    """The elements of a mesh.

    Attributes
    ----------
    tetrahedra : (m, 4) int array
        Node ids, ascending: every stored block then belongs to an upper block of the matrix. Odd permutations turn an
        element inside out, which nothing notices: gradients do not depend on the order, volumes are taken before it.
    shape_gradients : (m, 3, 3) array
        Inverse edge matrices; their rows are the gradients of the shape functions of nodes 1 to 3.
    nodes : wp.array of vec4i, shape (m,)
    inverse_edges : wp.array of mat33, shape (m,)
    """

    tetrahedra: Ints
    shape_gradients: Floats
    nodes: wp.array
    inverse_edges: wp.array


@dataclass(frozen=True, eq=False)
class PlacedPattern:
    """The attributes of `Pattern` of these names, on a device."""

    offsets: wp.array
    columns: wp.array
    diagonal: wp.array
    block_pairs: wp.array
    pairs: wp.array
    positions: wp.array
    first: wp.array
    contributions: wp.array
    corner_first: wp.array
    corners: wp.array


#: Patterns of one mesh at most: those of a finer mesh take a tenth of a gigabyte.
_PATTERNS = 6


def placed_mesh(mesh: TetMesh, device: wp.Device, precision: Precision) -> PlacedMesh:
    """The elements of a mesh on a device."""
    known, key = mesh.shared.setdefault("placed", {}), (device.alias, precision.name)
    if key not in known:
        tetrahedra = np.sort(mesh.tetrahedra, axis=1)
        edges = mesh.points[tetrahedra[:, 1:]] - mesh.points[tetrahedra[:, :1]]
        gradients: Floats = np.linalg.inv(edges.transpose(0, 2, 1)).astype(np.float64, copy=False)
        nodes = wp.array(tetrahedra, dtype=wp.vec4i, device=device)
        known[key] = PlacedMesh(tetrahedra, gradients, nodes, wp.array(gradients, dtype=precision.mat33, device=device))
    return known[key]


def placed_pattern(
    mesh: TetMesh, stencils: Sequence[NDArray[np.integer]], count: int, device: wp.Device
) -> PlacedPattern:
    """The pattern of families of stencils over `count` nodes on a device; see `build_pattern`."""
    said = sha256()
    for nodes in stencils:
        said.update(str((nodes.shape, nodes.dtype)).encode())
        said.update(np.ascontiguousarray(nodes).tobytes())
    known, key = mesh.shared.setdefault("patterns", {}), (device.alias, count, said.digest())
    if key not in known:
        for oldest in list(known)[: max(len(known) + 1 - _PATTERNS, 0)]:
            known.pop(oldest, None)
        pattern = build_pattern(stencils, count)
        kinds = {"pairs": wp.vec2i, "positions": wp.vec2i}
        known[key] = PlacedPattern(
            **{
                name: wp.array(values, dtype=kinds.get(name, int), device=device)
                for name, values in vars(pattern).items()
            }
        )
    return known[key]
