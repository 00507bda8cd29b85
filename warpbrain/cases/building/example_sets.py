"""Sets that examples of mechanisms act on: a ball, a membrane in the midline and one side of the surface."""

from __future__ import annotations

import numpy as np

from warpbrain.mesh import TetMesh

#: Centre and radius of the ball [m], in the right hemisphere.
CENTRE, RADIUS = (0.035, -0.015, 0.030), 0.018
#: Height above which there is a membrane, and how far to the right the side begins [m].
MEMBRANE_ABOVE, SIDE_BEYOND = 0.020, 0.060


def with_example_sets(mesh: TetMesh) -> TetMesh:
    """The phantom's mesh with the element set ``ball`` and the node sets ``falx`` and ``side``.

    The mesh knows of no midline: the membrane goes along the faces nearest to it.
    """
    middles = mesh.points[mesh.tetrahedra].mean(axis=1)
    right = middles[:, 0] > 0.0
    shared = np.zeros((2, len(mesh.points)), dtype=bool)
    shared[0, mesh.tetrahedra[right]] = True
    shared[1, mesh.tetrahedra[~right]] = True
    nodes = {
        "falx": shared.all(axis=0) & (mesh.points[:, 2] > MEMBRANE_ABOVE),
        "side": mesh.node_sets["surface"] & ~mesh.node_sets["fixed"] & (mesh.points[:, 0] > SIDE_BEYOND),
    }
    ball = np.linalg.norm(middles - CENTRE, axis=1) < RADIUS
    return TetMesh(mesh.points, mesh.tetrahedra, mesh.tissue, {**mesh.node_sets, **nodes}, {"ball": ball})
