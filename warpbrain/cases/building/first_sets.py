"""Node sets of a new mesh: the outer surface, the walls of its cavities, and a first guess of where it is held."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpbrain.mesh.surface import face_vectors, nodes_of, split_boundary

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# the base: what faces down this much, in this lower share of the height
FACING = -0.35
LOWER = 0.35


def first_sets(
    points: ArrayLike, tetrahedra: ArrayLike, is_cavity: Callable[[Floats, Floats], Bools] | None = None
) -> dict[str, Bools]:
    """Sets ``surface``, ``base`` and, if there are cavities, ``ventricle``.

    Parameters
    ----------
    points : (n, 3) array
        Positions, RAS, any unit.
    tetrahedra : (m, 4) array
        Positively oriented.
    is_cavity : callable, optional
        From centres (b, 3) and outward unit normals (b, 3) of outer faces to whether they are the wall of a cavity that
        opens to the outside (b,).

    Returns
    -------
    dict of (n,) bool arrays
    """
    xyz = np.asarray(points, dtype=np.float64)
    outer, cavities = split_boundary(xyz, tetrahedra)
    vectors = face_vectors(xyz, outer)
    opened = np.zeros(len(outer), dtype=bool)
    if is_cavity is not None:
        opened = is_cavity(xyz[outer].mean(axis=1), vectors / np.linalg.norm(vectors, axis=1, keepdims=True))
    walls = np.concatenate([outer[opened], *cavities])
    surface = nodes_of(outer[~opened], len(xyz))
    total = np.zeros_like(xyz)
    np.add.at(total, outer.ravel(), np.repeat(vectors, 3, axis=0))
    up = total[:, 2] / np.maximum(np.linalg.norm(total, axis=1), np.finfo(float).tiny)
    height = xyz[:, 2] - xyz[:, 2].min()
    sets = {"surface": surface, "base": surface & (up < FACING) & (height < LOWER * height.max())}
    if len(walls):
        sets["ventricle"] = nodes_of(walls, len(xyz))
    return sets
