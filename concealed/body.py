"""The body that effects act on: what the resection leaves of a mesh, with its walls as faces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from warpbrain.mesh import QuadraticMesh, TetMesh, boundary_faces, node_areas, split_boundary

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Body:
    """A brain after its resection.

    Attributes
    ----------
    mesh : TetMesh
        What is left [m, RAS].
    side : {"left", "right"}
        Of the resection.
    cavity, ventricle, cortex : (f, 3) int array
        Faces of the wall the resection left, of the ventricles, and of the rest of the outer surface; outward.
    """

    mesh: TetMesh
    side: str
    cavity: Ints
    ventricle: Ints
    cortex: Ints

    @cached_property
    def quadratic(self) -> QuadraticMesh:
        """The mesh with midside nodes, on which equilibrium is found; nodes of `mesh` come first."""
        return QuadraticMesh(self.mesh)

    @property
    def centroids(self) -> Floats:
        """Middle of each tetrahedron [m], shape (m, 3)."""
        return self.mesh.points[self.mesh.tetrahedra].mean(axis=1)

    @property
    def cavity_centre(self) -> Floats:
        """Middle of the wall of the cavity [m], shape (3,)."""
        area = node_areas(self.mesh.points, self.cavity)
        return area @ self.mesh.points / area.sum()

    @property
    def outwards(self) -> Floats:
        """Unit vector from the middle to the side of the resection, shape (3,)."""
        return np.array([-1.0 if self.side == "left" else 1.0, 0.0, 0.0])


def body_of(whole: TetMesh, side: str) -> Body:
    """The body of a mesh that still has its resected tissue."""
    left, nodes, _ = whole.without(whole.element_sets["resection"])
    outer, cavities = split_boundary(left.points, left.tetrahedra)
    # a face of the new wall is a face that the whole brain's surface does not have
    old = {tuple(face) for face in np.sort(boundary_faces(whole.tetrahedra), axis=1).tolist()}
    fresh = np.array([tuple(face) not in old for face in np.sort(nodes[outer], axis=1).tolist()])
    return Body(left, side, outer[fresh], cavities[0], outer[~fresh])
