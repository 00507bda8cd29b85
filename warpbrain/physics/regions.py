"""Where in a body something is: a ball, an element set, or all of it; and which way it points there."""

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.mesh import TetMesh
from warpbrain.physics.mechanism import ParameterError

#: Balls whose weights are kept, the latest ones.
_KEPT = 1024


def region_weights(
    mesh: TetMesh, elements: str, centre: tuple[float, float, float] | None, radius: float | None
) -> Floats:
    """How much each element belongs to a region, 0 to 1, shape (m,): to an element set, a ball [m], or all if neither.

    In a ball it falls smoothly from 1 at the centre to 0 at twice the radius, and is 1/2 at the radius.
    `ParameterError` if both a set and a ball are given, or half a ball, or the region holds nothing.
    """
    if (centre is None) != (radius is None):
        missing = "radius" if radius is None else "centre"
        raise ParameterError(missing, "missing: a ball has a centre and a radius")
    if centre is None or radius is None:
        if not elements:
            return np.ones(len(mesh.tetrahedra))
        weights = mesh.element_sets[elements].astype(np.float64)
    elif elements:
        raise ParameterError("elements", "given beside centre and radius: a region is a set or a ball")
    else:
        near, inside = _ball_weights(mesh, tuple(map(float, centre)), float(radius))
        weights = np.zeros(len(mesh.tetrahedra))
        weights[near] = inside
    if not weights.any():
        raise ParameterError("centre" if centre is not None else "elements", "no element is in this region")
    return weights


@lru_cache(maxsize=_KEPT)
def _ball_weights(mesh: TetMesh, centre: tuple[float, ...], radius: float) -> tuple[Ints, Floats]:
    """Elements in twice the radius, and their weights: a scan asks for each of its balls many times."""
    away = mesh.centres - np.array(centre)
    square = np.einsum("ei,ei->e", away, away)
    # most elements are far away: they need neither a root nor a cosine
    near = np.flatnonzero(square < (2.0 * radius) ** 2)
    return near, 0.5 * (1.0 + np.cos(0.5 * np.pi * np.sqrt(square[near]) / radius))


def elements_of(mesh: TetMesh, elements: str) -> Ints:
    """Ids of the elements of a set; all of them for an empty name."""
    return np.flatnonzero(mesh.element_sets[elements]) if elements else np.arange(len(mesh.tetrahedra))


def elements_with(mesh: TetMesh, faces: NDArray[np.integer]) -> Bools:
    """Elements (m,) that have one of some triangles (k, 3) as a face."""
    corners = np.sort(mesh.tetrahedra, axis=1)[:, [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]]
    size = len(mesh.points)
    keys = np.ravel_multi_index(np.moveaxis(corners, -1, 0), (size, size, size))
    of_faces = np.ravel_multi_index(np.sort(faces, axis=1).T, (size, size, size))
    return np.asarray(np.isin(keys, of_faces).any(axis=1))


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
        present = ", ".join(sorted(mesh.element_vectors)) or "none"
        raise ParameterError("field", f"the mesh has no array of directions '{field}' (it has {present})")
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
