"""Loads on the faces of quadratic tetrahedra, six nodes each, as nodal forces: on faces that are curved, too."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from concealed.body import Floats, Ints
from warpbrain.mesh.integrals import shape_values, triangle_rule

_POINTS, _WEIGHTS = triangle_rule()
#: Shape functions at the points of the rule, (6, 6), and corners at the ends of the sides that have midside nodes.
_VALUES = shape_values(_POINTS)
_SIDES = np.array([[0, 1], [0, 2], [1, 2]])
#: Derivatives of barycentric coordinates by the two that are independent.
_INDEPENDENT = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])

_OF_CORNERS = (4.0 * _POINTS - 1.0)[:, :, None] * _INDEPENDENT
_OF_MIDDLES = 4.0 * sum(_POINTS[:, _SIDES[:, i], None] * _INDEPENDENT[_SIDES[:, 1 - i]] for i in (0, 1))
#: Derivatives of shape functions by these, (6, 6, 2).
_DERIVATIVES = np.concatenate([_OF_CORNERS, _OF_MIDDLES], axis=1)


def area_vectors(points: Floats, faces: Ints) -> Floats:
    """Vectors of area [m2], outward, that belong to the six points of each face's rule: (f, 6, 3).

    Parameters
    ----------
    points : (N, 3) array
        Of all nodes [m].
    faces : (f, 6) int array
        Corners 0, 1, 2, then the middles of 01, 02 and 12.
    """
    along = np.einsum("qad,fax->dfqx", _DERIVATIVES, points[faces])
    return 0.5 * _WEIGHTS[:, None] * np.cross(along[0], along[1])


def pressure_forces(points: Floats, faces: Ints, pressure: float) -> Floats:
    """Nodal forces [N], shape (N, 3), of a pressure [Pa] that pushes against the outward side of faces (f, 6)."""
    return _summed(points, faces, -pressure * area_vectors(points, faces))


def traction_forces(points: Floats, faces: Ints, traction: Callable[[Floats], Floats]) -> Floats:
    """Nodal forces [N], shape (N, 3), of a traction [Pa] at points (k, 3) [m] of faces (f, 6)."""
    places = np.einsum("qa,fax->fqx", _VALUES, points[faces])
    areas = np.linalg.norm(area_vectors(points, faces), axis=2, keepdims=True)
    return _summed(points, faces, areas * traction(places.reshape(-1, 3)).reshape(places.shape))


def _summed(points: Floats, faces: Ints, of_points: Floats) -> Floats:
    """Forces (f, 6, 3) at the points of the rule as forces on nodes (N, 3)."""
    forces = np.zeros_like(points)
    np.add.at(forces, faces, np.einsum("qa,fqx->fax", _VALUES, of_points))
    return forces
