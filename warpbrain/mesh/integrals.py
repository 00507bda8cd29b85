"""Forces on nodes from forces in the volume and on the surface: `int N_a b dV` and `int N_a t dA`."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Floats
from warpbrain.mesh.quadratic import QuadraticMesh
from warpbrain.mesh.surface import face_vectors
from warpbrain.mesh.tet_mesh import TetMesh

#: Values (k, 3) of a field at points (k, 3).
Field = Callable[[Floats], Floats]


def _orbits(*orbits: tuple[float, tuple[float, ...]]) -> tuple[Floats, Floats]:
    """Barycentric points and weights of a rule, from weights and points that stand for all orders of coordinates."""
    from itertools import permutations

    points = [sorted(set(permutations(point))) for _, point in orbits]
    weights = np.repeat([weight for weight, _ in orbits], [len(same) for same in points])
    return np.concatenate(points), weights


@cache
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
    """Quadratic shape functions (q, 6) on triangles or (q, 10) on tetrahedra, at barycentric points (q, 3) or (q, 4).

    Those of corners, `L (2 L - 1)`, then those of edges, `4 L_a L_b`: 01, 02, 12 of a triangle, in the order of
    `warpbrain.mesh.surface.EDGES` of a tetrahedron.
    """
    triangle = bary.shape[1] == 3
    first, second = ((0, 0, 1), (1, 2, 2)) if triangle else ((0, 0, 0, 1, 1, 2), (1, 2, 3, 2, 3, 3))
    return np.concatenate([bary * (2.0 * bary - 1.0), 4.0 * bary[:, first] * bary[:, second]], axis=1)


def volume_forces(mesh: TetMesh | QuadraticMesh, density: Field) -> Floats:
    """Forces (n, 3) [N] of a smooth force in the volume [N/m3], by a rule of degree 5 on each tetrahedron.

    What jumps at a plane: `warpbrain.mesh.half_space`.
    """
    bary, weights = tetrahedron_rule()
    if isinstance(mesh, TetMesh):
        sizes = weights[:, None] * mesh.volumes
        return _summed(mesh, mesh.tetrahedra, _points_on(mesh.points[mesh.tetrahedra], bary), sizes, bary, density)
    corners = mesh.points[mesh.elements[:, :4]]
    sizes = weights[:, None] * mesh.corners.volumes
    return _summed(mesh, mesh.elements, _points_on(corners, bary), sizes, shape_values(bary), density)


def surface_forces(
    mesh: TetMesh | QuadraticMesh, traction: Field, triangles: NDArray[np.integer] | slice = slice(None)
) -> Floats:
    """Forces (n, 3) [N] of a force on the boundary [Pa], or on some of its triangles, by a rule of degree 4 on each."""
    bary, _ = triangle_rule()
    if isinstance(mesh, TetMesh):
        faces, shapes, (at, sizes) = mesh.boundary, bary, rule_on_boundary(mesh)
    else:
        faces, shapes, (at, sizes) = mesh.faces, shape_values(bary), rule_on_boundary(mesh.corners)
    return _summed(mesh, faces[triangles], at[:, triangles], sizes[:, triangles], shapes, traction)


def rule_on_boundary(mesh: TetMesh) -> tuple[Floats, Floats]:
    """Points (q, b, 3) [m] of the rule on the triangles of a boundary, and for what area (q, b) [m2] each stands.

    Made once for a mesh and all that share its elements.
    """
    rule: tuple[Floats, Floats] | None = mesh.shared.get("rule on boundary")
    if rule is None:
        bary, weights = triangle_rule()
        areas = np.linalg.norm(face_vectors(mesh.points, mesh.boundary), axis=1)
        rule = _points_on(mesh.points[mesh.boundary], bary), weights[:, None] * areas
        mesh.shared["rule on boundary"] = rule
    return rule


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
