"""Contact with the skull: the surface is stuck to it, slides along it, or can lift off it.

The skull is a rigid surface: the reference surface of the body itself, or a given closed one. A node of lumped area `A`
at the signed distance `g` from the closest point of it (positive beyond it) has the energy

    A/(2 k) <k g + q>^2,    <p> = max(0, p) where it can lift off, p where it only slides

`k` a penalty [Pa/m] and `q` the pressure that augmentation has found so far (Wriggers, Computational Contact Mechanics,
2nd ed., sections 6.3 and 6.7): in an equilibrium `q` becomes `<k g + q>` until what is left of `g` is small. Where the
surface is stuck the distance is that from where the node was, in all directions. With friction `f`, a force of at most
`f A <k g + q>` against the tangential displacement since the reference: right while a load grows, without memory of a
path. `<k g + q>` is there that of the last augmentation, or of the last time step: so the friction has an energy,
`f A p (sqrt(s^2 + d^2) - d)` with the slip `s` and `d` = 0.1 mm, over which it builds up.

A limit: nodes that slide along a curved surface of their own begin at its corners, where its direction jumps from face
to face, and Newton's method may not converge: for the whole surface of case 0529 it does not, for flat walls it does.
"""

from dataclasses import dataclass, field
from functools import cache
from typing import Any, ClassVar

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpbrain.kernels.closest import closest_on_triangle
from warpbrain.kernels.module import compiled_module
from warpbrain.kernels.precision import Precision
from warpbrain.mesh import TetMesh, boundary_faces, face_vectors, node_areas
from warpbrain.mesh.feature_normals import HOLLOW, RIM, SHARP, feature_normals
from warpbrain.physics.expectation import LogNormal
from warpbrain.physics.mechanism import Mechanism, ParameterError, parameter
from warpbrain.physics.term import Body, Term

STATES = ("fixed", "sliding", "lifting")
#: Tangential displacement [m] over which friction builds up.
_SLIP = 1e-4
#: Distance that is left [m] at which augmentation ends.
_NEAR = 1e-5


@dataclass(frozen=True, kw_only=True)
class Contact(Mechanism):
    """Contact of a node set with a rigid surface.

    Parameters
    ----------
    nodes : str
        Node set.
    state : str
        One of `STATES`.
    penalty : float
        `k`, relative to the stiffness of a layer of surface elements.
    friction : float
        Coefficient.
    points, faces : arrays, optional
        A closed surface [m], oriented outwards, which the nodes stay inside of; the body's own if absent.
    """

    nodes: str = parameter("Node set that touches the skull.", kind="node set")
    state: str = parameter("What it does there.", kind="text", choices=STATES, default="sliding")
    friction: float = parameter(
        "Coefficient of friction.",
        default=0.0,
        above=-1e-12,
        expectation=LogNormal(0.1, 3.0),
        typical="normal strength of the interface 2.8 to 3.4 kPa, tangential 1.8 to 2.1 kPa (sheep)",
        source="diagnosis design, M4",
    )
    penalty: float = parameter(
        "Stiffness of the contact, relative to that of a layer of elements.", default=50.0, above=0.0
    )
    points: NDArray[np.float64] | None = field(default=None, repr=False, compare=False)
    faces: NDArray[np.int32] | None = field(default=None, repr=False, compare=False)
    kind: ClassVar[str] = "contact"
    sentence: ClassVar[str] = "The brain's surface is not stuck to the skull: it slides along it, or lifts off."
    confused_with: ClassVar[tuple[str, ...]] = ("traction", "gravity")
    needs: ClassVar[tuple[str, ...]] = ("points near the surface",)
    several: ClassVar[bool] = True

    def check(self, mesh: TetMesh) -> None:
        super().check(mesh)
        self.skull(mesh)

    def skull(self, mesh: TetMesh) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
        """Points [m] and outward triangles of the surface it touches."""
        if self.points is not None and self.faces is not None:
            return self.points, outward(self.points, self.faces)
        own = boundary_faces(mesh.tetrahedra)
        own = own[mesh.node_sets[self.nodes][own].all(axis=1)]
        if not len(own):
            raise ParameterError("nodes", f"node set '{self.nodes}' holds no face of the surface")
        return mesh.points, own

    def held(self, mesh: TetMesh) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        members = np.flatnonzero(mesh.node_sets[self.nodes])
        if self.state == "fixed":
            return np.repeat(members, 3), np.tile(np.eye(3), (len(members), 1))
        return members, _vertex_normals(mesh)[members]

    def bind(self, body: Body) -> "ContactTerm":
        """See `warpbrain.physics.term.Following`."""
        return ContactTerm(body, self)


def outward(points: NDArray[np.float64], faces: NDArray[np.int32]) -> NDArray[np.int32]:
    """Triangles of a closed surface, all turned if they enclose a negative volume."""
    a, b, c = (points[faces[:, i]] - points.mean(axis=0) for i in range(3))
    return faces if np.einsum("ij,ij->", a, np.cross(b, c)) > 0.0 else faces[:, ::-1]


class ContactTerm(Term):
    """`Contact` on a device; a stencil is a node."""

    def __init__(self, body: Body, contact: Contact) -> None:
        members = np.flatnonzero(body.mesh.node_sets[contact.nodes])
        super().__init__(body, members[:, None], contact.factor)
        self.mechanism = contact
        precision, device = body.precision, body.device
        points, faces = contact.skull(body.mesh)
        used, corners = np.unique(faces, return_inverse=True)
        self._skull = wp.Mesh(
            points=wp.array(points[used], dtype=wp.vec3f, device=device),
            indices=wp.array(corners.ravel(), dtype=int, device=device),
        )
        self._corners = self.array(corners.reshape(-1, 3), wp.vec3i)
        self._skull_points = self.array(points[used], precision.vec3)
        normals, features = feature_normals(points[used], corners.reshape(-1, 3))
        self._normals = self.array(normals, precision.vec3)
        self._features = self.array(features, int)
        area = node_areas(body.mesh.points, boundary_faces(body.mesh.tetrahedra))[members]
        modulus = body.shear_moduli.max() + body.volumetric_moduli.max()
        self.stiffness = contact.penalty * modulus / float(np.sqrt(np.median(area)))
        self._area = self.array(area, precision.scalar)
        self._nodes = self.array(members, int)
        self._points = self.array(body.mesh.points, precision.vec3)
        self._found = wp.zeros(len(members), dtype=precision.scalar, device=device)
        self._pressing = wp.zeros(len(members), dtype=precision.scalar, device=device)
        self._gaps = wp.zeros(len(members), dtype=precision.scalar, device=device)
        self._energies = wp.zeros(len(members), dtype=precision.scalar, device=device)
        self._kernels = _kernels(precision)
        self._reach = float(np.linalg.norm(np.ptp(body.mesh.points, axis=0)))

    def set_scale(self, scale: float) -> None:
        # a wall is there, however little of the load is
        super().set_scale(1.0)

    def _launch(self, kernel: Any, u: wp.array, *outputs: wp.array) -> None:
        scalar = self.body.precision.scalar
        inputs = [
            self._nodes, self._points, self._area, self._skull.id, self._skull_points, self._corners,
            self._normals, self._features, STATES.index(self.mechanism.state), scalar(self.stiffness),
            scalar(self.mechanism.friction), scalar(self._reach), self._found, self._pressing, u, *outputs,
        ]  # fmt: skip
        wp.launch(kernel, dim=len(self.stencils), inputs=inputs, device=self.body.device)

    def evaluate_forces(self, u: wp.array) -> None:
        self._launch(self._kernels[0], u, self.forces)

    def evaluate_tangents(self, u: wp.array) -> None:
        self.evaluate_forces(u)
        self._launch(self._kernels[1], u, self.blocks)

    def energy(self, u: wp.array) -> float:
        self._launch(self._kernels[2], u, self._energies, self._gaps)
        return float(np.sum(self._energies.numpy(), dtype=np.float64))

    def gaps(self, u: wp.array) -> NDArray[np.float64]:
        """Signed distance (k,) [m] of each node beyond the surface."""
        self.energy(u)
        return self._gaps.numpy().astype(np.float64)

    def augment(self, u: wp.array) -> bool:
        if self.mechanism.state == "fixed":
            return False
        gaps, found = self.gaps(u), self._found.numpy().astype(np.float64)
        pressure = self.stiffness * gaps + found
        if self.mechanism.state == "lifting":
            pressure = np.maximum(pressure, 0.0)
        self._found.assign(pressure)
        self._pressing.assign(np.maximum(pressure, 0.0))
        # what is left of the distance where the surface is touched
        return bool(np.abs(pressure - found).max() > _NEAR * self.stiffness)

    def advance(self, u: wp.array) -> None:
        if self.mechanism.friction > 0.0:
            self._pressing.assign(np.maximum(self.stiffness * self.gaps(u) + self._found.numpy(), 0.0))

    def forget(self) -> None:
        self._found.zero_()
        self._pressing.zero_()


def _vertex_normals(mesh: TetMesh) -> NDArray[np.float64]:
    faces = boundary_faces(mesh.tetrahedra)
    normals = np.zeros_like(mesh.points)
    np.add.at(normals, faces.ravel(), np.repeat(face_vectors(mesh.points, faces), 3, axis=0))
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.where(lengths > 0.0, lengths, 1.0)


@cache
def _kernels(precision: Precision) -> tuple[Any, Any, Any]:
    """Kernels for forces, tangent blocks, and energies with distances; one thread for a node."""
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    module = compiled_module(f"contact_{precision.name}")
    slip = wp.constant(scalar(_SLIP))
    sharp, hollow, rim = wp.constant(SHARP), wp.constant(HOLLOW), wp.constant(RIM)

    @wp.func
    def nearest(
        skull: wp.uint64,
        points: wp.array[vec3],
        corners: wp.array[wp.vec3i],
        normals: wp.array2d[vec3],
        features: wp.array2d[int],
        x: vec3,
        reach: scalar,
    ):
        """Signed distance beyond the surface, direction out of it, and `H` of `closest_on_triangle`."""
        # which triangle is found in single precision; where on it, in the precision of everything else
        query = wp.mesh_query_point_no_sign(skull, wp.vec3f(x), wp.float32(reach))
        i = corners[query.face]
        p, feature, H = closest_on_triangle(x, points[i[0]], points[i[1]], points[i[2]])
        away = x - p
        n = normals[query.face, feature]
        along = wp.dot(away, n)
        gap = along
        # beyond a rim the wall goes on as the plane of its last triangle
        kind = features[query.face, feature]
        if kind != rim and wp.length(away) > scalar(1e-12) * reach:
            gap = wp.length(away)
            if along < scalar(0.0):
                gap = -gap
            n = away / gap
        region = (gap > scalar(0.0) and (kind & sharp) != 0) or (gap < scalar(0.0) and (kind & hollow) != 0)
        if not region:
            H = wp.outer(n, n)
        return gap, n, H

    @wp.kernel(module=module)
    def forces(
        nodes: wp.array[int],
        points: wp.array[vec3],
        area: wp.array[scalar],
        skull: wp.uint64,
        skull_points: wp.array[vec3],
        corners: wp.array[wp.vec3i],
        normals: wp.array2d[vec3],
        features: wp.array2d[int],
        state: int,
        k: scalar,
        friction: scalar,
        reach: scalar,
        found: wp.array[scalar],
        pressing: wp.array[scalar],
        u: wp.array[vec3],
        out: wp.array2d[vec3],
    ):
        t = wp.tid()
        d = u[nodes[t]]
        if state == 0:
            out[t, 0] = area[t] * k * d
            return
        gap, n, _H = nearest(skull, skull_points, corners, normals, features, points[nodes[t]] + d, reach)
        pressure = k * gap + found[t]
        if state == 2:
            pressure = wp.max(pressure, scalar(0.0))
        f = pressure * n
        if friction > scalar(0.0):
            s = d - wp.dot(d, n) * n
            f += friction * pressing[t] / wp.sqrt(wp.dot(s, s) + slip * slip) * s
        out[t, 0] = area[t] * f

    @wp.kernel(module=module)
    def tangents(
        nodes: wp.array[int],
        points: wp.array[vec3],
        area: wp.array[scalar],
        skull: wp.uint64,
        skull_points: wp.array[vec3],
        corners: wp.array[wp.vec3i],
        normals: wp.array2d[vec3],
        features: wp.array2d[int],
        state: int,
        k: scalar,
        friction: scalar,
        reach: scalar,
        found: wp.array[scalar],
        pressing: wp.array[scalar],
        u: wp.array[vec3],
        out: wp.array2d[mat33],
    ):
        t = wp.tid()
        one = wp.identity(n=3, dtype=scalar)
        if state == 0:
            out[t, 0] = area[t] * k * one
            return
        d = u[nodes[t]]
        gap, n, H = nearest(skull, skull_points, corners, normals, features, points[nodes[t]] + d, reach)
        pressure = k * gap + found[t]
        K = mat33()
        if state == 1 or pressure > scalar(0.0):
            # d(pressure n)/dx = k n n^T + pressure dn/dx, and gap dn/dx = H - n n^T
            K = k * wp.outer(n, n)
            if wp.abs(gap) > scalar(1e-12) * reach:
                # a pressure that would push around the corner makes the tangent indefinite: left to Newton's method
                K += wp.max(pressure / gap, scalar(0.0)) * (H - wp.outer(n, n))
        if friction > scalar(0.0):
            s = d - wp.dot(d, n) * n
            size = wp.sqrt(wp.dot(s, s) + slip * slip)
            K += friction * pressing[t] / size * (one - wp.outer(n, n) - wp.outer(s, s) / (size * size))
        out[t, 0] = area[t] * K

    @wp.kernel(module=module)
    def energies(
        nodes: wp.array[int],
        points: wp.array[vec3],
        area: wp.array[scalar],
        skull: wp.uint64,
        skull_points: wp.array[vec3],
        corners: wp.array[wp.vec3i],
        normals: wp.array2d[vec3],
        features: wp.array2d[int],
        state: int,
        k: scalar,
        friction: scalar,
        reach: scalar,
        found: wp.array[scalar],
        pressing: wp.array[scalar],
        u: wp.array[vec3],
        out: wp.array[scalar],
        gaps: wp.array[scalar],
    ):
        t = wp.tid()
        d = u[nodes[t]]
        if state == 0:
            gaps[t] = wp.length(d)
            out[t] = scalar(0.5) * area[t] * k * wp.dot(d, d)
            return
        gap, n, _H = nearest(skull, skull_points, corners, normals, features, points[nodes[t]] + d, reach)
        pressure = k * gap + found[t]
        if state == 2:
            pressure = wp.max(pressure, scalar(0.0))
        gaps[t] = gap
        s = d - wp.dot(d, n) * n
        rubbed = friction * pressing[t] * (wp.sqrt(wp.dot(s, s) + slip * slip) - slip)
        out[t] = area[t] * (scalar(0.5) / k * pressure * pressure + rubbed)

    return forces, tangents, energies
