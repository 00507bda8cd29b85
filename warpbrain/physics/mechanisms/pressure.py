"""Pressure on faces of the surface, which follows them as they move and turn.

The internal force of a triangle is `p` times its outward area vector: a pressure pushes inwards. Of the tangent there
is the symmetric part (`warpbrain.kernels.following_pressure`). On a closed surface, and on an open one whose rim is
held, that is all of it: the sum is the second derivative of `p V`, `V` the volume that the surface encloses. Where a
rim moves, the load has no energy, and the rest of `df/dx` is skew and acts along the rim alone:

    K_ab = -p/2 int N_a N_b [dx]                        along the rim, as the triangles run along it

Linear solvers of the equilibrium are for symmetric matrices and leave it out; it is about the pressure beside the
shear modulus. Forces are exact, so the equilibrium is. Newton's method learns what is missing from the steps that it
has taken (`warpbrain.simulation.multisecant`): -1.2 kPa on the wall of 0529's resection take 8 iterations, 10 without
that. The line search takes the work along a step for the change of energy. No cap is put on an opening: its pressure
would have to be carried by the tissue at the rim, and what closes an opening (skull, dura, a dressing) bears its share
itself. So the pressure has a resultant, `p` times the opening.

The wall of a resection is part of the surface of what is left: `nodes` names its nodes, or the element set that was
taken out if the mesh has no node set of that name. Triangles of the surface beside it, whose nodes are all on the rim,
are no part of it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from warpbrain.arrays import Bools, Floats, Int32s
from warpbrain.kernels.following_pressure import pressure_kernels
from warpbrain.mesh import TetMesh, faces_of, rim_edges
from warpbrain.mesh.integrals import triangle_rule
from warpbrain.mesh.surface import SIDES
from warpbrain.physics.mechanism import Changed, Expectation, Mechanism, ParameterError, Reading, parameter
from warpbrain.physics.potential import Enters
from warpbrain.physics.proposal import NotTestableError, Proposal, Situation
from warpbrain.physics.regions import elements_with
from warpbrain.physics.term import Body, TriangleTerm

#: Nodes of the sides of triangles, one way around, by how many nodes these have.
_SIDES = {3: SIDES, 6: np.array([[0, 3, 1], [1, 5, 2], [2, 4, 0]])}


@dataclass(frozen=True, kw_only=True)
class Pressure(Mechanism):
    """A pressure that follows the faces of a node set."""

    nodes: str = parameter("Node set whose faces carry it.", kind="node set")
    value: float = parameter(
        "Pressure, relative to that on the rest of the surface; positive pushes on the tissue.",
        unit="Pa",
        expectation=Expectation.normal(0.0, 200.0),
        typical="10 to 1000 Pa across the cerebral mantle",
        source="volunteers: 7 to 14 Pa; hydrocephalus: tens to hundreds of Pa (diagnosis design, M2)",
        told=(
            "it is {} higher there than elsewhere, and pushes the wall into the tissue",
            "it is {} lower there than elsewhere, and pulls the wall out of the tissue, towards the fluid",
            "it is {} above that elsewhere",
        ),
    )
    kind: ClassVar[str] = "pressure"
    quadratic: ClassVar[bool] = True
    enters: ClassVar[Enters] = Enters("beside", "W_pressure")
    changes: ClassVar[Changed] = "loads"
    together: ClassVar[Mapping[str, str]] = {
        "pressure": "A face of both node sets carries the sum.",
        "resection": "It acts on the faces of the node set that the surface of what is left has.",
        "swelling": "It acts on the faces as they are, grown or not.",
    }
    sentence: ClassVar[str] = "Fluid presses on part of the surface, more than on the rest of it."
    example: ClassVar[str] = "pressure:nodes=ventricle,value=300"
    absence: ClassVar[str] = "pressure of fluid in ventricles and cavity"
    confused_with: ClassVar[tuple[str, ...]] = ("gravity", "swelling")
    several: ClassVar[bool] = True
    # 2 mm of water in a manometer
    reading: ClassVar[Reading | None] = Reading(20.0, "a reading of the pressure, to 20 Pa")

    def check(self, mesh: TetMesh) -> None:
        super().check(mesh)
        self.faces(mesh)

    def faces(self, mesh: TetMesh) -> Int32s:
        """Triangles (k, 3) that carry the pressure, oriented outwards."""
        loaded = faces_of(mesh, mesh.node_sets[self.nodes])
        if not len(loaded):
            wall = self.nodes in mesh.element_sets
            cure = f" (the wall of '{self.nodes}' is part of it once that is taken out by a resection)" if wall else ""
            raise ParameterError(
                "nodes", f"node set '{self.nodes}' holds no face of the surface, which a pressure needs{cure}"
            )
        return loaded

    def acts_on(self, mesh: TetMesh) -> Bools:
        return elements_with(mesh, self.faces(mesh))

    @classmethod
    def proposals(cls, situation: Situation) -> Sequence[Proposal]:
        """On every free surface."""
        if not situation.free:
            raise NotTestableError("needs a part of the surface that nothing holds")
        sd = 400.0 * situation.stiffness
        return [
            Proposal.of_one(
                lambda p, at=surface.name: cls(nodes=at, value=p), 0.0, sd, region=surface.words, varying=(0,)
            )
            for surface in situation.free
        ]

    def bind(self, body: Body) -> "PressureTerm":
        return PressureTerm(body, self.faces(body.mesh), self.value, self.factor)


class PressureTerm(TriangleTerm):
    """A pressure [Pa] on triangles (k, 3) of a body, oriented away from the tissue that it pushes on."""

    def __init__(self, body: Body, faces: Int32s, value: float, ramp: Callable[[float], float]) -> None:
        order = np.argsort(faces, axis=1)
        # a permutation of three is even if it is a rotation
        even = (order[:, 1] - order[:, 0]) % 3 == 1
        ascending = np.take_along_axis(faces, order, axis=1)
        rim = rim_edges(faces)
        triangles, rule = ascending, np.array([[1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0, 1.0]])
        if body.quadratic is not None:
            triangles, rule = body.quadratic.six_nodes(ascending), np.column_stack(triangle_rule())
            rim = np.concatenate([rim, body.quadratic.middles(rim)[:, None]], axis=1)
        kernels = pressure_kernels(body.precision, triangles.shape[1], tuple(map(tuple, rule.tolist())))
        super().__init__(
            body,
            triangles,
            body.node_mesh.points - body.mesh.points[faces].mean(axis=(0, 1)),
            value * np.where(even, 1.0, -1.0),
            kernels,
            ramp,
        )
        self.conservative = value == 0.0 or not body.movable[rim].any()
        self._rim, self._pressure = rim, value * np.where(even, 1.0, -1.0)

    def skew_stiffness(self, u: Floats) -> Any:
        """See `Term`, and the module: of sides of triangles on the rim."""
        from scipy.sparse import coo_matrix

        body, count = self.body, self.stencils.shape[1]
        # the nodes of each side one after the other, and the sides of the rim
        sides = self.stencils[:, _SIDES[count]].astype(np.int64)
        ends = np.sort(sides[:, :, [0, -1]], axis=2) @ [len(u), 1]
        triangles, which = np.nonzero(np.isin(ends, self._rim[:, :2] @ [len(u), 1]))
        nodes = sides[triangles, which]
        # `int N_a N_b dx` from shape functions and their slopes on [0, 1], by a rule of degree 5
        t, weights = np.polynomial.legendre.leggauss(3)
        t = 0.5 + 0.5 * t
        shapes, slopes = np.stack([1.0 - t, t]), np.array([[-1.0], [1.0]]) + 0.0 * t
        if count == 6:
            shapes = np.stack([(1.0 - t) * (1.0 - 2.0 * t), 4.0 * t * (1.0 - t), t * (2.0 * t - 1.0)])
            slopes = np.stack([4.0 * t - 3.0, 4.0 - 8.0 * t, 4.0 * t - 1.0])
        integrals = np.einsum("q,aq,bq,cq->abc", 0.5 * weights, shapes, shapes, slopes)
        along = np.einsum("abc,sci->sabi", integrals, (body.node_mesh.points + u)[nodes])
        along *= (-0.5 * self._pressure[triangles] * float(self.scale.numpy()[0]))[:, None, None, None]
        # matrices of `d x`
        values = np.cross(np.eye(3), along[..., None, :])
        components = 3 * nodes[:, :, None] + np.arange(3)
        rows, columns = components[:, :, None, :, None], components[:, None, :, None, :]
        indices = [np.broadcast_to(index, values.shape).ravel() for index in (rows, columns)]
        return coo_matrix((values.ravel(), tuple(indices)), shape=(u.size, u.size)).tocsr()
