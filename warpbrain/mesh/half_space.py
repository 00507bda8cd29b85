"""Integrals of shape functions over the part of each tetrahedron above a plane, and over the plane inside it.

A tetrahedron is cut by a plane into tetrahedra: one at a corner that is alone on its side, three in the wedge where two
corners are on each side. On these the shape functions are polynomials, which the rules below integrate exactly, so the
result is the integral but for rounding, wherever the plane lies. By the transport theorem a plane that moves with the
speed `r` along its normal changes the integral over what is above it by

    d/dt int_(above) N_a dV = int_(plane) N_a (-r) dA.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from warpbrain.arrays import Floats, Ints
from warpbrain.mesh.integrals import shapes_of, triangle_rule
from warpbrain.mesh.quadratic import QuadraticMesh
from warpbrain.mesh.tet_mesh import TetMesh

#: Barycentric points of a rule of degree 2 on a tetrahedron, of equal weights (Keast 1986); exact for quadratic shapes.
_ALPHA = (5.0 - np.sqrt(5.0)) / 20.0
_RULE = np.full((4, 4), _ALPHA) + (1.0 - 4.0 * _ALPHA) * np.eye(4)
#: Corners of three tetrahedra that fill a wedge with the triangles 0 1 2 and 3 4 5, and of two triangles that fill its
#: side 1 2 5 4.
_WEDGE = ((0, 1, 2, 3), (1, 2, 3, 4), (2, 3, 4, 5))
_QUADRILATERAL = ((1, 2, 5), (1, 5, 4))


def integrals_of_shapes(mesh: TetMesh | QuadraticMesh) -> Floats:
    """`int N_a dV` over each tetrahedron [m3], shape (m, 4) or (m, 10)."""
    if isinstance(mesh, TetMesh):
        return np.repeat(mesh.volumes[:, None] / 4.0, 4, axis=1)
    return mesh.corners.volumes[:, None] * np.repeat([-1.0 / 20.0, 1.0 / 5.0], [4, 6])


def integrals_above(mesh: TetMesh | QuadraticMesh, up: ArrayLike, level: float) -> Floats:
    """`int N_a dV` over the part of each tetrahedron where `x . up > level`.

    `up` (3,): unit normal of the plane. `level`: its distance from the origin along `up` [m]. Returns (m, 4) or
    (m, 10) [m3], for the nodes of each tetrahedron in the order of `shapes_of`; not to be written to.
    """
    up = np.asarray(up, dtype=np.float64)

    def integrals() -> Floats:
        cut = _Cut(mesh, up, float(level))
        whole = integrals_of_shapes(mesh)
        result = np.where((cut.count == 4)[:, None], whole, 0.0)
        for elements, corners, sign in cut.solids():
            # sign -1: what is below is cut off from the whole
            bary = np.einsum("qc,kca->kqa", _RULE, corners)
            volumes = np.abs(np.linalg.det(corners)) * cut.volumes[elements]
            np.add.at(result, elements, sign * (volumes[:, None] * cut.shapes(bary).mean(axis=1)))
        below = cut.count == 3
        result[below] += whole[below]
        return result

    key = (type(mesh), "integrals above", float(level), *up.tolist())
    return shapes_of(mesh)[0].made_once(key, integrals)


def integrals_on_plane(
    mesh: TetMesh | QuadraticMesh, up: ArrayLike, level: float, weight: Callable[[Floats], Floats]
) -> Floats:
    """`int N_a w dA` over the part of the plane `x . up = level` inside each tetrahedron.

    `mesh`, `up`, `level`: see `integrals_above`. `weight`: from points (k, 3) [m] on the plane to values (k,); exact
    for polynomials of degree 2. Returns (m, 4) or (m, 10) [m2] times the unit of the weight.
    """
    cut = _Cut(mesh, np.asarray(up, dtype=np.float64), level)
    rule, shares = triangle_rule()
    integrals = np.zeros(integrals_of_shapes(mesh).shape)
    for elements, corners in cut.sections():
        bary = np.einsum("qc,kca->kqa", rule, corners)
        points = np.einsum("kqa,kai->kqi", bary, cut.corners[elements])
        x = np.einsum("kca,kai->kci", corners, cut.corners[elements])
        areas = 0.5 * np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1)
        values = weight(points.reshape(-1, 3)).reshape(points.shape[:2]) * shares * areas[:, None]
        np.add.at(integrals, elements, np.einsum("kq,kqs->ks", values, cut.shapes(bary)))
    return integrals


def summed_at_nodes(mesh: TetMesh | QuadraticMesh, values: Floats) -> Floats:
    """Values (m, s, ...) at the nodes of tetrahedra, added up at each node (n, ...)."""
    nodes, count = shapes_of(mesh)[1].ravel(), len(mesh.points)
    columns = values.reshape(len(nodes), -1).T
    sums = [np.bincount(nodes, weights=column, minlength=count).astype(np.float64) for column in columns]
    return np.stack(sums, axis=1).reshape(count, *values.shape[2:])


class _Cut:
    """Tetrahedra and a plane: how many corners lie above it, and the polyhedra and polygons that it cuts out.

    A corner on the plane is taken for one below it, so that a face on the plane belongs to the tetrahedron above.
    """

    def __init__(self, mesh: TetMesh | QuadraticMesh, up: Floats, level: float) -> None:
        tetrahedra, elements, self.shapes = shapes_of(mesh)
        self.volumes, self.corners = tetrahedra.volumes, mesh.points[elements[:, :4]]
        self._heights = self.corners @ up - level
        self.count = (self._heights > 0.0).sum(axis=1)
        # the highest first: those above the plane come before those below it
        self._order = np.argsort(-self._heights, axis=1, kind="stable")
        alone_above, alone_below, self._half = (np.flatnonzero(self.count == count) for count in (1, 3, 2))
        self._tips = [
            (alone_above, self._around(alone_above, 0, (1, 2, 3)), 1.0),
            (alone_below, self._around(alone_below, 3, (0, 1, 2)), -1.0),
        ]
        self._wedge = np.concatenate([self._around(self._half, tip, (2, 3)) for tip in (0, 1)], axis=1)

    def _around(self, elements: Ints, tip: int, others: tuple[int, ...]) -> Floats:
        """Barycentric coordinates of the corner of a rank in height, and of where the plane cuts its edges to others.

        (k, 1 + number of others, 4), of elements (k,).
        """
        order = self._order[elements]
        corners, heights = np.eye(4)[order], np.take_along_axis(self._heights[elements], order, axis=1)
        points = [corners[:, tip]]
        for other in others:
            share = (heights[:, tip] / (heights[:, tip] - heights[:, other]))[:, None]
            points.append((1.0 - share) * corners[:, tip] + share * corners[:, other])
        return np.stack(points, axis=1)

    def solids(self) -> list[tuple[Ints, Floats, float]]:
        """Ids (k,) of tetrahedra, corners (k, 4, 4) of a part of each in barycentric coordinates, and its sign."""
        return self._tips + [(self._half, self._wedge[:, part], 1.0) for part in _WEDGE]

    def sections(self) -> list[tuple[Ints, Floats]]:
        """Ids (k,) of tetrahedra, and corners (k, 3, 4) of triangles of the plane in them."""
        triangles = [(elements, corners[:, 1:]) for elements, corners, _ in self._tips]
        return triangles + [(self._half, self._wedge[:, part]) for part in _QUADRILATERAL]
