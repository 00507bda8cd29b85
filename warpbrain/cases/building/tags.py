"""Named node sets of a brain mesh: where it is held, pressed, open and cut.

All rules are in template millimetres, on positions and outward normals, so that they mean the same for every size of
mesh and every individual.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.building.errors import BuildError
from warpbrain.mesh.surface import face_vectors, interface_faces, nodes_of, split_boundary

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# superior cap: depth under the highest point, and how much the surface there faces up (not the walls of the fissure)
CAP_DEPTH = 15.0
CAP_FACING = 0.5
# skull base: what faces down this much ...
BASE_FACING = -0.35
# ... below the roof of the Sylvian fissure, which faces down but not on bone; farther back, below the tentorium, on
# which the occipital lobes lie
ANTERIOR_FLOOR = -10.0
TENTORIUM = -30.0
BEHIND = -45.0


def node_sets(points: Floats, tetrahedra: NDArray[np.int64]) -> dict[str, Bools]:
    """Sets ``surface``, ``ventricle``, ``superior`` and ``fixed``.

    Parameters
    ----------
    points : (n, 3) array
        Positions [mm, template].
    tetrahedra : (m, 4) array
        Positively oriented.

    Returns
    -------
    dict of (n,) bool arrays
    """
    outer, cavities = split_boundary(points, tetrahedra)
    if len(cavities) != 1:
        raise BuildError(f"expected one cavity, the lateral ventricles; found {len(cavities)} cavities")
    count = len(points)
    surface = nodes_of(outer, count)
    total = np.zeros_like(points)
    np.add.at(total, outer.ravel(), np.repeat(face_vectors(points, outer), 3, axis=0))
    up = total[:, 2] / np.maximum(np.linalg.norm(total, axis=1), 1e-12)
    y, z = points[:, 1], points[:, 2]
    below = z < np.where(y < BEHIND, TENTORIUM, ANTERIOR_FLOOR)
    return {
        "ventricle": nodes_of(cavities[0], count),
        "surface": surface,
        "superior": surface & (z > z[surface].max() - CAP_DEPTH) & (up > CAP_FACING),
        "fixed": surface & below & (up < BASE_FACING),
    }


def margin(tetrahedra: NDArray[np.int64], resected: Bools, count: int) -> tuple[Bools, Bools]:
    """Nodes (count,) of the wall a resection leaves, and nodes (count,) that only resected tissue has."""
    wall = nodes_of(interface_faces(tetrahedra, resected), count)
    gone = nodes_of(tetrahedra[resected], count) & ~nodes_of(tetrahedra[~resected], count)
    return wall, gone
