"""A membrane inside the tissue: the falx or the tentorium.

On each triangle, with `F` (3 x 2) its deformation gradient in its own plane, `C = F^T F`, thickness `t` and shear
modulus `mu`, the incompressible neo-Hookean membrane (Bonet and Wood, Nonlinear Continuum Mechanics, 2nd ed., section
6.6)

    W = A t mu/2 (tr C + 1/det C - 3),   P = t mu F (I - C^-1 / det C)
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar, TypeAlias

import numpy as np
import warp as wp

from warpbrain.arrays import Int32s
from warpbrain.kernels.following_pressure import triangles_struct
from warpbrain.kernels.module import Precision, compiled_module
from warpbrain.mesh import TetMesh
from warpbrain.mesh.surface import all_faces
from warpbrain.physics.mechanism import Expectation, Mechanism, ParameterError, parameter
from warpbrain.physics.potential import Enters
from warpbrain.physics.proposal import NotTestableError, Proposal, Situation
from warpbrain.physics.term import Body, TriangleTerm


@dataclass(frozen=True, kw_only=True)
class Falx(Mechanism):
    """A membrane on the faces of a node set, inside the tissue or on its surface."""

    nodes: str = parameter("Node set of the membrane: faces of which all nodes are in it.", kind="node set")
    stiffness: float = parameter(
        "Young's modulus.",
        default=31.5e6,
        unit="MPa",
        si=1e6,
        above=0.0,
        expectation=Expectation.log_normal(31.5, 2.0),
        typical="31.5 MPa by custom; 68.1 MPa in pooled tests of dura",
        source="diagnosis design, M5",
    )
    thickness: float = parameter(
        "Thickness.", default=1e-3, unit="mm", si=1e-3, above=0.0, typical="about 1 mm", source="diagnosis design, M5"
    )
    kind: ClassVar[str] = "falx"
    quadratic: ClassVar[bool] = True
    enters: ClassVar[Enters] = Enters("beside", "W_falx")
    together: ClassVar[Mapping[str, str]] = {
        "cavity": "Only tissue is taken out: the membrane stays.",
        "falx": "A face of both node sets carries two membranes.",
        "inclusion": "The membrane is not tissue of the region: its stiffness stays.",
        "resection": "Of the membrane the faces stay that tissue still holds.",
        "swelling": "The membrane does not grow: it holds what swells.",
        "viscoelasticity": "The membrane does not relax.",
    }
    sentence: ClassVar[str] = "A stiff membrane, such as the falx, holds the tissue on both sides of it."
    example: ClassVar[str] = "falx:nodes=falx"
    absence: ClassVar[str] = "falx and tentorium"
    confused_with: ClassVar[tuple[str, ...]] = ("inclusion", "contact")
    switches: ClassVar[bool] = True
    several: ClassVar[bool] = True

    def check(self, mesh: TetMesh) -> None:
        super().check(mesh)
        self.faces(mesh)

    @classmethod
    def proposals(cls, situation: Situation) -> Sequence[Proposal]:
        """On node sets that are called so."""
        names = [name for name in situation.mesh.node_sets if any(word in name for word in ("falx", "tentorium"))]
        if not names:
            raise NotTestableError("needs a node set 'falx' or 'tentorium' in the mesh")
        return [Proposal.switch(cls(nodes=nodes), 0.3, region=nodes) for nodes in names]

    def faces(self, mesh: TetMesh) -> Int32s:
        """Triangles (k, 3) of the membrane."""
        faces = all_faces(mesh.tetrahedra)
        membrane = faces[mesh.node_sets[self.nodes][faces].all(axis=1)]
        if not len(membrane):
            raise ParameterError("nodes", f"node set '{self.nodes}' holds no face of the mesh")
        return membrane

    def bind(self, body: Body) -> "MembraneTerm":
        return MembraneTerm(body, self)


class MembraneTerm(TriangleTerm):
    """`Falx` on a device: the membrane is there, however little of the load is."""

    in_full = True

    def __init__(self, body: Body, falx: Falx) -> None:
        faces = np.sort(falx.faces(body.node_mesh), axis=1)
        corners = body.node_mesh.points[faces]
        first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        # two directions in the plane, then the gradients of the shape functions of nodes 1 and 2 in them
        along = first / np.linalg.norm(first, axis=1, keepdims=True)
        across = second - np.einsum("kj,kj->k", second, along)[:, None] * along
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        edges = np.stack(
            [np.stack([np.einsum("kj,kj->k", e, d) for d in (along, across)], -1) for e in (first, second)], 1
        )
        gradients = np.linalg.inv(edges).transpose(0, 2, 1)
        area = 0.5 * np.abs(np.linalg.det(edges))
        modulus = falx.factor() * falx.thickness * falx.stiffness / 3.0
        data = np.concatenate([(modulus * area)[:, None], gradients.reshape(-1, 4)], axis=1)
        super().__init__(body, faces, body.node_mesh.points, data, _kernels(body.precision), falx.factor)


@cache
def _kernels(precision: Precision) -> tuple[Any, Any, Any]:
    """Kernels for forces, tangent blocks and energies, with one thread for a triangle."""
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    vec2, mat22 = wp.types.vector(2, scalar), wp.types.matrix((2, 2), scalar)
    module = compiled_module(f"falx_{precision.name}")
    Triangles: TypeAlias = triangles_struct(precision)

    @wp.func
    def columns(s: Triangles, u: wp.array[vec3], t: int):
        """The two columns of `F`; of displacements, so that small strains keep their digits."""
        g1 = vec2(s.data[t, 1], s.data[t, 2])
        g2 = vec2(s.data[t, 3], s.data[t, 4])
        a = s.nodes[t, 0]
        b = s.nodes[t, 1]
        c = s.nodes[t, 2]
        e1 = s.points[b] - s.points[a] + (u[b] - u[a])
        e2 = s.points[c] - s.points[a] + (u[c] - u[a])
        return g1[0] * e1 + g2[0] * e2, g1[1] * e1 + g2[1] * e2

    @wp.func
    def metric(F1: vec3, F2: vec3):
        return mat22(wp.dot(F1, F1), wp.dot(F1, F2), wp.dot(F1, F2), wp.dot(F2, F2))

    @wp.kernel(module=module)
    def forces(s: Triangles, u: wp.array[vec3], out: wp.array2d[vec3]):
        t = wp.tid()
        F1, F2 = columns(s, u, t)
        C = metric(F1, F2)
        S = s.scale[0] * s.data[t, 0] * (wp.identity(n=2, dtype=scalar) - wp.inverse(C) / wp.determinant(C))
        P1 = S[0, 0] * F1 + S[1, 0] * F2
        P2 = S[0, 1] * F1 + S[1, 1] * F2
        f1 = s.data[t, 1] * P1 + s.data[t, 2] * P2
        f2 = s.data[t, 3] * P1 + s.data[t, 4] * P2
        out[t, 0] = -(f1 + f2)
        out[t, 1] = f1
        out[t, 2] = f2

    @wp.func
    def block(F1: vec3, F2: vec3, S: mat22, inverse: mat22, over: scalar, g: vec2, h: vec2):
        """`g . dP . h`, `dS = over (C^-1 dC C^-1 + tr(C^-1 dC) C^-1)`."""
        cg = inverse * g
        ch = inverse * h
        # F C^-1 g and so on
        a = cg[0] * F1 + cg[1] * F2
        b = ch[0] * F1 + ch[1] * F2
        inner = wp.dot(g, ch)
        # F C^-1 F^T
        M1 = inverse[0, 0] * F1 + inverse[1, 0] * F2
        M2 = inverse[0, 1] * F1 + inverse[1, 1] * F2
        K = over * (inner * (wp.outer(F1, M1) + wp.outer(F2, M2)) + wp.outer(b, a) + scalar(2.0) * wp.outer(a, b))
        return K + wp.dot(g, S * h) * wp.identity(n=3, dtype=scalar)

    @wp.kernel(module=module)
    def tangents(s: Triangles, u: wp.array[vec3], out: wp.array2d[mat33]):
        t = wp.tid()
        F1, F2 = columns(s, u, t)
        C = metric(F1, F2)
        inverse = wp.inverse(C)
        over = s.scale[0] * s.data[t, 0] / wp.determinant(C)
        S = s.scale[0] * s.data[t, 0] * wp.identity(n=2, dtype=scalar) - over * inverse
        g1 = vec2(s.data[t, 1], s.data[t, 2])
        g2 = vec2(s.data[t, 3], s.data[t, 4])
        K11 = block(F1, F2, S, inverse, over, g1, g1)
        K12 = block(F1, F2, S, inverse, over, g1, g2)
        K22 = block(F1, F2, S, inverse, over, g2, g2)
        K01 = -(K11 + wp.transpose(K12))
        K02 = -(K12 + K22)
        out[t, 0] = -(K01 + K02)
        out[t, 1] = K01
        out[t, 2] = K02
        out[t, 3] = K11
        out[t, 4] = K12
        out[t, 5] = K22

    @wp.kernel(module=module)
    def energies(s: Triangles, u: wp.array[vec3], out: wp.array[scalar]):
        t = wp.tid()
        F1, F2 = columns(s, u, t)
        C = metric(F1, F2)
        unit = scalar(1.0)
        W = wp.trace(C) + unit / wp.determinant(C) - scalar(3.0)
        out[t] = scalar(0.5) * s.scale[0] * s.data[t, 0] * W

    return forces, tangents, energies
