"""Node sets of new meshes: surfaces, where a brain is held, pressed and cut, and what examples act on."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.errors import InputError
from warpbrain.mesh import TetMesh
from warpbrain.mesh.surface import face_vectors, node_vectors, nodes_of, split_boundary

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


def node_sets(points: Floats, tetrahedra: Ints) -> dict[str, Bools]:
    """Sets (n,) ``surface``, ``ventricle``, ``superior`` and ``fixed`` of a template brain, held, pressed and open.

    All rules are in template millimetres, on positions and outward normals, so that they mean the same for every size
    of mesh and every individual.
    """
    outer, cavities = split_boundary(points, tetrahedra)
    if len(cavities) != 1:
        raise InputError(f"expected one cavity, the lateral ventricles; found {len(cavities)} cavities")
    count = len(points)
    surface = nodes_of(outer, count)
    up = _facing_up(points, outer)
    y, z = points[:, 1], points[:, 2]
    below = z < np.where(y < BEHIND, TENTORIUM, ANTERIOR_FLOOR)
    return {
        "ventricle": nodes_of(cavities[0], count),
        "surface": surface,
        "superior": surface & (z > z[surface].max() - CAP_DEPTH) & (up > CAP_FACING),
        "fixed": surface & below & (up < BASE_FACING),
    }


# the base: what faces down this much, in this lower share of the height
FACING = -0.35
LOWER = 0.35


def first_sets(
    points: ArrayLike, tetrahedra: ArrayLike, is_cavity: Callable[[Floats, Floats], Bools] | None = None
) -> dict[str, Bools]:
    """Sets (n,) of a user's mesh: ``surface``, ``base``, a first guess of where it is held, and ``ventricle`` if there
    are cavities.

    `points` (n, 3), `tetrahedra` (m, 4): RAS, any unit, positively oriented. `is_cavity`: from centres (b, 3) and
    outward unit normals (b, 3) of outer faces to whether they are the wall of a cavity that opens to the outside (b,).
    """
    xyz = np.asarray(points, dtype=np.float64)
    outer, cavities = split_boundary(xyz, tetrahedra)
    vectors = face_vectors(xyz, outer)
    opened = np.zeros(len(outer), dtype=bool)
    if is_cavity is not None:
        opened = is_cavity(xyz[outer].mean(axis=1), vectors / np.linalg.norm(vectors, axis=1, keepdims=True))
    walls = np.concatenate([outer[opened], *cavities])
    surface = nodes_of(outer[~opened], len(xyz))
    height = xyz[:, 2] - xyz[:, 2].min()
    low = (_facing_up(xyz, outer) < FACING) & (height < LOWER * height.max())
    sets = {"surface": surface, "base": surface & low}
    if len(walls):
        sets["ventricle"] = nodes_of(walls, len(xyz))
    return sets


def _facing_up(points: Floats, faces: NDArray[np.integer[Any]]) -> Floats:
    """How much the surface faces up at each node (n,): 1 up, -1 down, 0 where there are no faces."""
    total = node_vectors(points, faces)
    return np.asarray(total[:, 2] / np.maximum(np.linalg.norm(total, axis=1), np.finfo(float).tiny))


#: Centre and radius of the ball [m], in the right hemisphere.
CENTRE, RADIUS = (0.035, -0.015, 0.030), 0.018
#: Height above which there is a membrane, and how far to the right the side begins [m].
MEMBRANE_ABOVE, SIDE_BEYOND = 0.020, 0.060


def with_example_sets(mesh: TetMesh) -> TetMesh:
    """The phantom's mesh with the element set ``ball`` and the node sets ``falx`` and ``side``.

    The mesh knows of no midline: the membrane goes along the faces nearest to it.
    """
    right = mesh.centres[:, 0] > 0.0
    of_right, of_left = (nodes_of(mesh.tetrahedra[side], len(mesh.points)) for side in (right, ~right))
    nodes = {
        "falx": of_right & of_left & (mesh.points[:, 2] > MEMBRANE_ABOVE),
        "side": mesh.node_sets["surface"] & ~mesh.node_sets["fixed"] & (mesh.points[:, 0] > SIDE_BEYOND),
    }
    ball = np.linalg.norm(mesh.centres - CENTRE, axis=1) < RADIUS
    return replace(mesh, node_sets={**mesh.node_sets, **nodes}, element_sets={"ball": ball})
