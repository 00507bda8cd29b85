"""Directions that users give: one for all of a body, or one for each element of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpbrain.mesh import TetMesh
from warpbrain.physics.mechanism import ParameterError

Floats = NDArray[np.float64]


def unit_vector(key: str, direction: ArrayLike) -> Floats:
    """A direction (3,) at length one; `ParameterError` of the key if it has none."""
    vector = np.asarray(direction, dtype=float)
    with np.errstate(over="ignore", invalid="ignore"):
        length = float(np.linalg.norm(vector)) if vector.shape == (3,) else 0.0
    if not (np.isfinite(length) and length > 0.0):
        raise ParameterError(key, f"found {np.ravel(vector).tolist()}, expected 3 numbers that are not all zero")
    return np.asarray(vector / length)


def element_directions(
    mesh: TetMesh, elements: NDArray[np.integer], direction: tuple[float, float, float] | None, field: str
) -> Floats:
    """Unit vectors (k, 3) of some elements (k,), from one direction or from vectors that the mesh has by that name.

    `ParameterError` if neither or both are given, the mesh has no such vectors, or one of them is no direction.
    """
    if (direction is None) == (not field):
        raise ParameterError("direction", "give either one direction or a field of them")
    if direction is not None:
        return np.tile(unit_vector("direction", direction), (len(elements), 1))
    if field not in mesh.element_vectors:
        known = ", ".join(sorted(mesh.element_vectors)) or "none"
        raise ParameterError("field", f"the mesh has no array of directions '{field}' (it has {known})")
    vectors = mesh.element_vectors[field][elements]
    with np.errstate(over="ignore", invalid="ignore"):
        lengths = np.linalg.norm(vectors, axis=1)
    bad = np.flatnonzero(~(np.isfinite(lengths) & (lengths > 0.0)))
    if len(bad):
        raise ParameterError(
            "field",
            f"'{field}' has no direction in {len(bad)} of {len(elements)} elements that need one, first in element "
            f"{elements[bad[0]]}: {vectors[bad[0]].tolist()}",
        )
    return np.asarray(vectors / lengths[:, None])
