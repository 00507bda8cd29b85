"""Is every part of a body held? Without that there is no equilibrium, and a solver would look for it in vain."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from warpbrain.errors import InputError
from warpbrain.mesh import TetMesh
from warpbrain.simulation.model import Model


def require_held(model: Model) -> None:
    """Raise `InputError` if a connected part of the body can move as a rigid one.

    Each part needs constrained components, or mechanisms that hold it, that exclude its six rigid motions.
    """
    mesh = model.node_mesh
    count = len(mesh.points)
    parts, part = _connected_parts(mesh)
    holding = [mechanism.held(mesh) for mechanism in model.mechanisms]
    for number in range(parts):
        members = np.flatnonzero(part == number)
        x = mesh.points[members] - mesh.points[members].mean(axis=0)
        size = float(np.abs(x).max())
        # three translations and three rotations of each node, as rows (node, component)
        motions = np.zeros((len(members), 3, 6))
        motions[:, :, :3] = np.eye(3)
        for axis in range(3):
            motions[:, :, 3 + axis] = np.cross(np.eye(3)[axis], x) / size
        held = motions[model.constrained[members]]
        for nodes, directions in holding:
            own = np.isin(nodes, members)
            rows = motions[np.searchsorted(members, nodes[own])]
            held = np.concatenate([held, np.einsum("ki,kij->kj", directions[own], rows)])
        rank = int(np.linalg.matrix_rank(held, tol=1e-6)) if len(held) else 0
        if rank < 6:
            where = 1000.0 * mesh.points[members].mean(axis=0)
            which = "the body" if parts == 1 else f"a part of {len(members)} of {count} nodes"
            raise InputError(
                f"{which} around ({where[0]:.0f}, {where[1]:.0f}, {where[2]:.0f}) mm is not held: its constrained "
                f"nodes leave {6 - rank} of 6 rigid motions free, so it has no equilibrium"
            )


@lru_cache(maxsize=4)
def _connected_parts(mesh: TetMesh) -> tuple[int, NDArray[np.int32]]:
    """How many there are, and which of them each node (n,) belongs to; a mesh is asked for every state of it."""
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import connected_components

    count = len(mesh.points)
    first = np.repeat(mesh.tetrahedra[:, 0], 3)
    others = mesh.tetrahedra[:, 1:].ravel()
    links = csr_matrix((np.ones(len(first), dtype=np.int8), (first, others)), shape=(count, count))
    parts, part = connected_components(links, directed=False)
    return int(parts), part
