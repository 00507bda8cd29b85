"""Pressure on faces of the surface, which follows them as they move and turn.

On a triangle with the deformed nodes `x_a` and outward area vector `n = 1/2 sum_a x_a x x_(a+1)` (reference Bonet and
Wood, Nonlinear Continuum Mechanics, 2nd ed., section 8.5)

    f_a = p n / 3                                       internal force: a pressure pushes inwards, against `n`
    K_ab = p/12 ([d_b] - [d_a]),   d_a = x_(a-1) - x_(a+1),   [d] v = d x v

`K_ab` is the symmetric part of `df_a/dx_b`. On a closed surface that is all of it: the sum is the second derivative of
`p V`, `V` the volume that the surface encloses. On an open one whose rim moves, the rest acts along the rim and is left
to Newton's method, which then converges linearly. Triangles of six nodes: `warpbrain.kernels.curved_pressure`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, ClassVar

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpbrain.kernels.curved_pressure import curved_pressure_kernels
from warpbrain.kernels.module import compiled_module
from warpbrain.kernels.precision import Precision
from warpbrain.mesh import TetMesh
from warpbrain.mesh.integrals import triangle_rule
from warpbrain.mesh.soundness import open_edges
from warpbrain.physics.expectation import Normal
from warpbrain.physics.mechanism import Mechanism, ParameterError, parameter
from warpbrain.physics.potential import Enters
from warpbrain.physics.proposal import NotTestableError, Proposal, Situation
from warpbrain.physics.regions import elements_with
from warpbrain.physics.term import Body
from warpbrain.physics.triangle_term import TriangleTerm

Ints = NDArray[np.int32]


@dataclass(frozen=True, kw_only=True)
class Pressure(Mechanism):
    """A pressure that follows the faces of a node set.

    Parameters
    ----------
    nodes : str
        Node set; its faces of the mesh's surface carry the pressure.
    value : float
        [Pa], positive pushes on the tissue.
    """

    nodes: str = parameter("Node set whose faces carry it.", kind="node set")
    value: float = parameter(
        "Pressure, relative to that on the rest of the surface; positive pushes on the tissue.",
        unit="Pa",
        expectation=Normal(0.0, 200.0),
        typical="10 to 1000 Pa across the cerebral mantle",
        source="volunteers: 7 to 14 Pa; hydrocephalus: tens to hundreds of Pa (diagnosis design, M2)",
    )
    kind: ClassVar[str] = "pressure"
    quadratic: ClassVar[bool] = True
    enters: ClassVar[Enters] = Enters("beside", "W_pressure")
    together: ClassVar[Mapping[str, str]] = {
        "pressure": "A face of both node sets carries the sum.",
        "resection": "It acts on the faces of the node set that the surface of what is left has.",
        "swelling": "It acts on the faces as they are, grown or not.",
    }
    sentence: ClassVar[str] = "Fluid presses on part of the surface, more than on the rest of it."
    example: ClassVar[str] = "pressure:nodes=ventricle,value=300"
    confused_with: ClassVar[tuple[str, ...]] = ("gravity", "swelling")
    several: ClassVar[bool] = True

    def check(self, mesh: TetMesh) -> None:
        super().check(mesh)
        self.faces(mesh)

    def faces(self, mesh: TetMesh) -> Ints:
        """Triangles (k, 3) that carry the pressure, oriented outwards."""
        faces = mesh.boundary
        own = faces[mesh.node_sets[self.nodes][faces].all(axis=1)]
        if not len(own):
            raise ParameterError(
                "nodes", f"node set '{self.nodes}' holds no face of the surface, which a pressure needs"
            )
        return own

    def acts_on(self, mesh: TetMesh) -> NDArray[np.bool_]:
        return elements_with(mesh, self.faces(mesh))

    @classmethod
    def proposals(cls, situation: Situation) -> Sequence[Proposal]:
        """On every set of free faces that is not most of the surface: that would be a pressure all around."""
        every = len(situation.mesh.boundary)
        found = []
        for nodes in situation.free:
            part = len(cls(nodes=nodes, value=0.0).faces(situation.mesh)) / every
            if part < 0.5:
                make = partial(_pressing, nodes)
                found.append(Proposal.of_one(make, 0.0, 400.0, region=nodes))
        if not found:
            raise NotTestableError("needs a node set with faces of the free surface, such as a ventricle's wall")
        return found

    def bind(self, body: Body) -> "PressureTerm":
        """See `warpbrain.physics.term.Following`."""
        return PressureTerm(body, self)


def _pressing(nodes: str, value: float) -> Pressure:
    return Pressure(nodes=nodes, value=value)


class PressureTerm(TriangleTerm):
    """`Pressure` on a device."""

    def __init__(self, body: Body, pressure: Pressure) -> None:
        faces = pressure.faces(body.mesh)
        order = np.argsort(faces, axis=1)
        # a permutation of three is even if it is a rotation
        even = (order[:, 1] - order[:, 0]) % 3 == 1
        ascending = np.take_along_axis(faces, order, axis=1)
        if body.quadratic is None:
            triangles, kernels = ascending, _kernels(body.precision)
        else:
            rule = np.column_stack(triangle_rule())
            triangles = body.quadratic.six_nodes(ascending)
            kernels = curved_pressure_kernels(body.precision, tuple(map(tuple, rule.tolist())))
        super().__init__(
            body,
            triangles,
            body.node_mesh.points - body.mesh.points[faces].mean(axis=(0, 1)),
            pressure.value * np.where(even, 1.0, -1.0),
            kernels,
            pressure.factor,
        )
        self.conservative = not len(open_edges(faces))


@cache
def _kernels(precision: Precision) -> tuple[Any, Any, Any]:
    """Kernels for forces, tangent blocks and energies, with one thread for a triangle."""
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    module = compiled_module(f"pressure_{precision.name}")

    @wp.kernel(module=module)
    def forces(
        nodes: wp.array[wp.vec3i],
        points: wp.array[vec3],
        value: wp.array[scalar],
        scale: wp.array[scalar],
        u: wp.array[vec3],
        out: wp.array2d[vec3],
    ):
        t = wp.tid()
        i = nodes[t]
        x0 = points[i[0]] + u[i[0]]
        normal = wp.cross(points[i[1]] + u[i[1]] - x0, points[i[2]] + u[i[2]] - x0)
        f = value[t] * scale[0] / scalar(6.0) * normal
        for a in range(3):
            out[t, a] = f

    @wp.kernel(module=module)
    def tangents(
        nodes: wp.array[wp.vec3i],
        points: wp.array[vec3],
        value: wp.array[scalar],
        scale: wp.array[scalar],
        u: wp.array[vec3],
        out: wp.array2d[mat33],
    ):
        t = wp.tid()
        i = nodes[t]
        p = value[t] * scale[0] / scalar(12.0)
        x0 = points[i[0]] + u[i[0]]
        x1 = points[i[1]] + u[i[1]]
        x2 = points[i[2]] + u[i[2]]
        # blocks (0,0), (0,1), (0,2), (1,1), (1,2), (2,2); those of a node with itself are zero
        out[t, 0] = mat33()
        out[t, 1] = p * wp.skew(x0 + x1 - x2 - x2)
        out[t, 2] = p * wp.skew(x1 + x1 - x0 - x2)
        out[t, 3] = mat33()
        out[t, 4] = p * wp.skew(x1 + x2 - x0 - x0)
        out[t, 5] = mat33()

    @wp.kernel(module=module)
    def energies(
        nodes: wp.array[wp.vec3i],
        points: wp.array[vec3],
        value: wp.array[scalar],
        scale: wp.array[scalar],
        u: wp.array[vec3],
        out: wp.array[scalar],
    ):
        t = wp.tid()
        i = nodes[t]
        x0 = points[i[0]] + u[i[0]]
        out[t] = (
            value[t] * scale[0] / scalar(6.0) * wp.dot(x0, wp.cross(points[i[1]] + u[i[1]], points[i[2]] + u[i[2]]))
        )

    return forces, tangents, energies
