"""Forces on nodes from forces in the volume and on the surface: `int N_a b dV` and `int N_a t dA`."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Floats, Int32s
from warpbrain.mesh.quadratic import QuadraticMesh
from warpbrain.mesh.surface import EDGES, face_vectors
from warpbrain.mesh.tet_mesh import TetMesh

#: Values (k, 3) of a field at points (k, 3).
Field = Callable[[Floats], Floats]


def _orbits(*orbits: tuple[float, tuple[float, ...]]) -> tuple[Floats, Floats]:
    """Barycentric points and weights of a rule, from weights and points that stand for all orders of coordinates."""
    from itertools import permutations

    points = [sorted(set(permutations(point))) for _, point in orbits]
    weights = np.repeat([weight for weight, _ in orbits], [len(same) for same in points])
    return np.concatenate(points), weights


def triangle_rule() -> tuple[Floats, Floats]:
    """Six points of a rule of degree 4 on a triangle (Dunavant 1985): barycentric points (6, 3), weights (6,)."""
    a, b = 0.445948490915965, 0.091576213509771
    return _orbits((0.223381589678011, (1 - 2 * a, a, a)), (0.109951743655322, (1 - 2 * b, b, b)))


def tetrahedron_rule() -> tuple[Floats, Floats]:
    """Fourteen points of a rule of degree 5 on a tetrahedron (Walkington 2000): points (14, 4), weights (14,)."""
    a, b, c = 0.3108859192633006, 0.0927352503108912, 0.0455037041256496
    return _orbits(
        (0.1126879257180159, (1 - 3 * a, a, a, a)),
        (0.0734930431163619, (1 - 3 * b, b, b, b)),
        (0.0425460207770815, (0.5 - c, 0.5 - c, c, c)),
    )


def shape_values(bary: Floats) -> Floats:
    """Quadratic shape functions (..., 6) on triangles or (..., 10) on tetrahedra, at barycentric points (..., 3 or 4).

    Those of corners, `L (2 L - 1)`, then those of edges, `4 L_a L_b`: 01, 02, 12 of a triangle, in the order of
    `warpbrain.mesh.surface.EDGES` of a tetrahedron.
    """
    first, second = EDGES[[0, 1, 3]].T if bary.shape[-1] == 3 else EDGES.T
    return np.concatenate([bary * (2.0 * bary - 1.0), 4.0 * bary[..., first] * bary[..., second]], axis=-1)


def shapes_of(mesh: TetMesh | QuadraticMesh) -> tuple[TetMesh, Int32s, Callable[[Floats], Floats]]:
    """The tetrahedra of a mesh, the nodes (m, 4) or (m, 10) of each, corners first, and their shape functions."""
    if isinstance(mesh, TetMesh):
        return mesh, mesh.tetrahedra, lambda bary: bary
    return mesh.corners, mesh.elements, shape_values


def volume_forces(mesh: TetMesh | QuadraticMesh, density: Field) -> Floats:
    """Forces (n, 3) [N] of a smooth force in the volume [N/m3], by a rule of degree 5 on each tetrahedron.

    What jumps at a plane: `warpbrain.mesh.half_space`.
    """
    bary, weights = tetrahedron_rule()
    corners, elements, shapes = shapes_of(mesh)
    at = _points_on(corners.points[elements[:, :4]], bary)
    return _summed(mesh, elements, at, weights[:, None] * corners.volumes, shapes(bary), density)


def surface_forces(
    mesh: TetMesh | QuadraticMesh, traction: Field, triangles: NDArray[np.integer] | slice = slice(None)
) -> Floats:
    """Forces (n, 3) [N] of a force on the boundary [Pa], or on some of its triangles, by a rule of degree 4 on each."""
    bary, weights = triangle_rule()
    corners, _, shapes = shapes_of(mesh)
    # points (q, b, 3) of the rule, and for what area (q, b) each stands: of all meshes that share these elements
    if "rule on boundary" not in corners.shared:
        areas = np.linalg.norm(face_vectors(corners.points, corners.boundary), axis=1)
        rule = _points_on(corners.points[corners.boundary], bary), weights[:, None] * areas
        corners.shared["rule on boundary"] = rule
    at, sizes = corners.shared["rule on boundary"]
    faces = mesh.boundary if isinstance(mesh, TetMesh) else mesh.faces
    return _summed(mesh, faces[triangles], at[:, triangles], sizes[:, triangles], shapes(bary), traction)


def _points_on(corners: Floats, bary: Floats) -> Floats:
    """Barycentric points (q, c) of elements with corners (k, c, 3): (q, k, 3)."""
    return np.asarray(np.einsum("qc,kci->qki", bary, corners, optimize=True))


def _summed(
    mesh: TetMesh | QuadraticMesh, nodes: NDArray[np.integer], at: Floats, sizes: Floats, shapes: Floats, field: Field
) -> Floats:
    """Sum over elements with nodes (k, s), at points (q, k, 3) that stand for sizes (q, k), shape values (q, s)."""
    values = field(at.reshape(-1, 3)).reshape(at.shape)
    # of a patch most elements have nothing
    acts = np.flatnonzero(values.any(axis=(0, 2)))
    force = sizes[:, acts, None] * values[:, acts]
    by_node = np.einsum("qs,qki->iks", shapes, force, optimize=True).reshape(3, -1)
    where, count = nodes[acts].ravel(), len(mesh.points)
    return np.column_stack([np.bincount(where, weights=along, minlength=count) for along in by_node])
