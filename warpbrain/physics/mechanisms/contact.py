"""Contact with the skull: the surface is stuck to it, slides along it, or can lift off it.

The skull is a rigid surface: the reference surface of the body itself, or a given closed one. What touches it is told
by its signed distance `g` (positive beyond it), smoothed by a spline of the spacing of the surface's edges
(`warpbrain.kernels.distance_field`): its level sets have no corners, so nodes slide along curved walls of triangles
without jumps. Of a body's own surface `g` counts from where each node was imaged. A node of lumped area `A` has the
energy, and from it the force and tangent

    A/(2 k) <k g + q>^2,   A p dg/dx,   A (k dg/dx (x) dg/dx + p d2g/dx2),   p = <k g + q>

`<p> = max(0, p)` where it can lift off, `p` where it only slides, `k` a penalty [Pa/m] and `q` the pressure that
augmentation has found so far (Wriggers, Computational Contact Mechanics, 2nd ed., sections 6.3 and 6.7): in an
equilibrium `q` becomes `<k g + q>` until what is left of `g` is small, and the `q` that is kept is the one that the
state is in equilibrium with. Where the surface is stuck, `g` and `q` are vectors, the displacement and a traction,
until what is left of the displacement is 5e-8 m. Motion knows no augmentation: there a stuck node gives way by its
load over `k A`.

With friction `f`, a force of at most `f A p` against the tangential displacement `s` since the reference: right while
a load grows, without memory of a path. Pressure and direction are there those of the last augmentation, which is
repeated until they are those of the state to 0.1 %, or of the last time step: so the friction has an energy,
`f A p (sqrt(s^2 + d^2) - d)`, with `d` = 0.1 mm, over which it builds up.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpbrain.arrays import Floats, Int32s, Ints
from warpbrain.kernels.distance_field import distance_kernels, smooth_distance
from warpbrain.kernels.module import Precision, compiled_module, threads_of_block
from warpbrain.mesh import TetMesh, faces_of, node_areas, vertex_normals
from warpbrain.mesh.quality import extent
from warpbrain.mesh.surface import feature_normals
from warpbrain.physics.mechanism import ClosedSurface, Expectation, Mechanism, ParameterError, parameter
from warpbrain.physics.potential import Enters
from warpbrain.physics.proposal import NotTestableError, Patch, Proposal, Situation
from warpbrain.physics.term import Body, KernelTerm
from warpbrain.physics.words import Values, measured

STATES = ("fixed", "sliding", "lifting")
#: Tangential displacement [m] over which friction builds up.
_SLIP = 1e-4
#: Distance that is left [m] at which augmentation ends, and displacement of what is stuck.
_NEAR, _STUCK = 1e-5, 5e-8
#: Part of the largest pressure by which those of friction may differ from those of the state.
_SETTLED = 1e-3
#: Nodes of the largest grid; a finer one is made coarser.
LARGEST_GRID = 2_000_000
#: Spacings that the grid goes beyond what it is made for.
_MARGIN = 4


@dataclass(frozen=True, kw_only=True)
class Contact(Mechanism):
    """Contact of a node set with a rigid surface."""

    nodes: str = parameter("Node set that touches the skull.", kind="node set")
    state: str = parameter("What it does there.", kind="text", choices=STATES, default="sliding")
    friction: float = parameter(
        "Coefficient of friction.",
        default=0.0,
        above=-1e-12,
        expectation=Expectation.log_normal(0.1, 3.0),
        typical="normal strength of the interface 2.8 to 3.4 kPa, tangential 1.8 to 2.1 kPa (sheep)",
        source="diagnosis design, M4",
    )
    penalty: float = parameter(
        "Stiffness of the contact, relative to that of a layer of elements.", default=50.0, above=0.0, method=True
    )
    surface: ClosedSurface | None = parameter(  # noqa: RUF009  (a field, as the others)
        "Closed surface of triangles that the nodes stay inside of: a .stl, .ply, .obj, .vtp or .vtu.",
        kind="surface",
        default=None,
        absent="the body's own surface as it was imaged",
    )
    kind: ClassVar[str] = "contact"
    enters: ClassVar[Enters] = Enters("beside", "W_contact")
    together: ClassVar[Mapping[str, str]] = {
        "contact": "A node of both sets meets both walls.",
        "drainage": "The wall carries the whole stress, of fluid and skeleton; where it drains is said apart.",
        "resection": "The wall is the surface of the tissue that is left, unless another one is given.",
        "swelling": "The wall stays where it was imaged, and holds what swells.",
    }
    sentence: ClassVar[str] = "The brain's surface is not stuck to the skull: it slides along it, or lifts off."
    example: ClassVar[str] = "contact:nodes=side,state=lifting"
    absence: ClassVar[str] = "contact with the skull away from the nodes that are fixed"
    confused_with: ClassVar[tuple[str, ...]] = ("traction", "gravity")
    needs: ClassVar[tuple[str, ...]] = ("points near the surface",)
    switches: ClassVar[bool] = True
    several: ClassVar[bool] = True

    def check(self, mesh: TetMesh) -> None:
        super().check(mesh)
        self.skull(mesh)
        if self.surface is None:
            return
        members = mesh.node_sets[self.nodes]
        if not members[mesh.boundary].any():
            raise ParameterError("nodes", f"node set '{self.nodes}' holds no node of the surface")
        size, held, body = map(extent, (self.surface.points, mesh.points[members], mesh.points))
        if size < 0.5 * held or size > 100.0 * body:
            raise ParameterError(
                "surface",
                f"'{self.surface}' is {1e3 * size:.4g} mm across, the nodes that it holds {1e3 * held:.4g} mm and the "
                f"body {1e3 * body:.4g} mm: is it in another unit?",
            )

    @classmethod
    def proposals(cls, situation: Situation) -> Sequence[Proposal]:
        """What is held slides or lifts off instead; what is free slides along a wall where it was, or meets it."""
        released = [cls._let_go(state, patch, situation.mesh) for patch in situation.held for state in STATES[1:]]
        walls = [
            Proposal.switch(cls(nodes=surface.name, state=state), 0.5, region=surface.words)
            for surface in situation.free
            for state in STATES[1:]
        ]
        if not released and not walls:
            raise NotTestableError("has no surface")
        return [*released, *walls]

    @classmethod
    def size_in_words(cls, values: Values, gravity_axis: tuple[float, float, float] | None = None) -> Sequence[str]:
        if "radius" not in values:
            return []
        return [f"what lets go has a radius of {measured(values['radius'].value, values['radius'].sd, 'mm')}"]

    @property
    def lifts(self) -> bool:
        return self.state == "lifting"

    @classmethod
    def _let_go(cls, state: str, patch: Patch, mesh: TetMesh) -> Proposal:
        def elsewhere(centre: Floats, radius: float) -> Proposal:
            return cls._let_go(state, Patch.disc(mesh, patch.surface, patch.held, centre, radius) or patch, mesh)

        return Proposal.switch(
            cls(nodes=patch.name, state=state),
            0.5,
            follows="release",
            patch=patch,
            elsewhere=None if patch.name == patch.surface else elsewhere,
            on_surface=True,
            centre=patch.centre,
            radius=patch.radius,
            region=f"surface '{patch.surface}', which is held",
        )

    def skull(self, mesh: TetMesh) -> tuple[Floats, Int32s]:
        """Points [m] and outward triangles of the surface it touches."""
        if self.surface is not None:
            return self.surface.points, self.surface.outward
        faces = faces_of(mesh, mesh.node_sets[self.nodes])
        if not len(faces):
            raise ParameterError("nodes", f"node set '{self.nodes}' holds no face of the surface")
        return mesh.points, faces

    def held(self, mesh: TetMesh) -> tuple[Ints, Floats]:
        members = np.flatnonzero(mesh.node_sets[self.nodes])
        if self.state == "fixed":
            return np.repeat(members, 3), np.tile(np.eye(3), (len(members), 1))
        return members, vertex_normals(mesh)[members]

    def bind(self, body: Body) -> "ContactTerm":
        return ContactTerm(body, self)


class ContactTerm(KernelTerm):
    """`Contact` on a device; a stencil is a node."""

    memory = ("_found", "_pressing", "_directions", "_tractions")
    lasting = ("_field", "_inputs")
    in_full = True

    def __init__(self, body: Body, contact: Contact) -> None:
        members = np.flatnonzero(body.mesh.node_sets[contact.nodes])
        made, *kernels = _kernels(body.precision)
        super().__init__(body, members[:, None], kernels, contact.factor)
        self.mechanism = contact
        self.is_smooth = contact.state != "lifting"
        precision = body.precision
        points, faces = contact.skull(body.mesh)
        boundary = body.mesh.boundary
        shared = np.isin(boundary, members)
        touching = boundary[shared.any(axis=1)]
        # of its own surface only differences count: the smoother, the better
        given = contact.surface is not None

        def make() -> DistanceField:
            # what the body's own triangles cannot follow need not be resolved
            spacing = min(_edge(points, faces), _edge(body.mesh.points, touching))
            return DistanceField(points, faces, spacing, body.mesh.points[members], given, body.device, precision)

        self._field = body.once("distance field", [points, faces, members, touching, np.array(given)], make)
        # a node at the rim of the set touches with what is in the set; one without a face there with all it has
        area = node_areas(body.mesh.points, boundary[shared.all(axis=1)])[members]
        area = np.where(area > 0.0, area, node_areas(body.mesh.points, boundary)[members])
        self._size = float(np.sqrt(np.median(area)))
        self._numbers = self.zeros(2)
        self.take_moduli()
        self._area = self.array(area, precision.scalar)
        self._nodes = self.array(members, int)
        self._movable, self._free = body.movable[members], ~body.constrained[members]
        self._points = self.array(body.mesh.points, precision.vec3)
        count = len(members)
        self._start, self._found, self._pressing, self._gaps = (self.zeros(count) for _ in range(4))
        self._directions, self._tractions = (self.zeros(count, dtype=precision.vec3) for _ in range(2))
        if not given:
            reached = self.array(body.mesh.points[members], precision.vec3)
            self._field.at(reached, self._start, wp.zeros_like(reached))
        wall = made()
        for name in ("_nodes", "_points", "_area", "_start", "_numbers", "_gaps", *self.memory):
            setattr(wall, name[1:], getattr(self, name))
        for name in ("coefficients", "origin", "spacing"):
            setattr(wall, name, getattr(self._field, name))
        self._inputs = (wall, STATES.index(contact.state))

    def take_moduli(self) -> None:
        modulus = self.body.shear_moduli.max() + self.body.volumetric_moduli.max()
        self.stiffness = self.mechanism.penalty * modulus / self._size
        self._numbers.assign([self.stiffness, self.mechanism.friction])

    def evaluate_tangents(self, u: wp.array) -> None:
        self.evaluate_forces(u)
        self._launch(self._kernels[1], u, self.blocks)

    def gaps(self, u: wp.array) -> Floats:
        """Signed distance (k,) [m] of each node beyond the surface."""
        self.energy(u)
        return self._gaps.numpy().astype(np.float64)

    def pressures(self) -> Floats:
        """Pressure (k,) [Pa] that augmentation has found on each node."""
        return self._found.numpy().astype(np.float64)

    def pressing(self) -> Floats:
        """Pressure (k,) [Pa] on each node that friction goes with."""
        return self._pressing.numpy().astype(np.float64)

    def augment(self, u: wp.array) -> bool:
        if self.mechanism.state == "fixed":
            return self._hold(u)
        gaps, before = self.gaps(u), self.pressures()
        pressure = self.stiffness * gaps + before
        if self.mechanism.state == "lifting":
            pressure = np.maximum(pressure, 0.0)
        # no pressure brings a node nearer whose place is prescribed
        pressure = np.where(self._movable, pressure, before)
        self._found.assign(pressure)
        rubbing = self.pressing()
        self._press(u, pressure)
        # what is left of the distance where the surface is touched
        if np.abs(pressure - before).max() > _NEAR * self.stiffness:
            return True
        pressing = np.maximum(pressure, 0.0)
        return self.mechanism.friction > 0.0 and bool(
            np.abs(pressing - rubbing).max() > _SETTLED * pressing.max() > 0.0
        )

    def _hold(self, u: wp.array) -> bool:
        """Take what holds nodes now as their tractions (k, 3) [Pa]; whether they moved too far for it."""
        moved = np.where(self._free, u.numpy().astype(np.float64)[self.stencils[:, 0]], 0.0)
        self._tractions.assign(self._tractions.numpy() + self.stiffness * moved)
        return bool(np.linalg.norm(moved, axis=1).max() > _STUCK)

    def advance(self, u: wp.array) -> None:
        if self.mechanism.friction != 0.0:
            self._press(u, self.stiffness * self.gaps(u) + self.pressures())

    def _press(self, u: wp.array, pressure: Floats) -> None:
        """Take a pressure (k,) [Pa] and the directions at a displacement [m] as those of friction."""
        self._pressing.assign(np.maximum(pressure, 0.0))
        reached = self.body.mesh.points[self.stencils[:, 0]] + u.numpy()[self.stencils[:, 0]]
        self._field.at(self.array(reached, self.body.precision.vec3), self._gaps, self._directions)


class DistanceField:
    """The smoothed signed distance from a surface, on a device; see `warpbrain.kernels.distance_field`.

    The surface is of points (n, 3) [m] and outward triangles (k, 3); beyond an open rim it goes on as the plane of its
    last triangle. The grid holds it and a region, points (r, 3) [m]. What is smaller than its spacing [m] is smoothed;
    that is larger than asked for where the grid would have more than `LARGEST_GRID` nodes. Smoothing alone shifts the
    surface by `h^2/6` times the sum of its curvatures: `in_place` takes that back, and is less smooth.
    """

    def __init__(
        self,
        points: Floats,
        faces: NDArray[np.integer],
        spacing: float,
        region: Floats,
        in_place: bool,
        device: Any,
        precision: Precision,
    ) -> None:
        self._device, self._precision = device, precision
        used, corners = np.unique(faces, return_inverse=True)
        corners = corners.reshape(-1, 3)
        surface = points[used]
        low = np.minimum(surface.min(axis=0), region.min(axis=0))
        size = np.maximum(surface.max(axis=0), region.max(axis=0)) - low
        self.spacing = max(spacing, float(np.prod(size + 2 * _MARGIN * spacing) / LARGEST_GRID) ** (1.0 / 3.0))
        low = low - _MARGIN * self.spacing
        shape = tuple(int(n) for n in np.ceil(size / self.spacing) + 2 * _MARGIN + 1)
        self.origin, surface = precision.vec3(*low), surface - low
        self.coefficients = wp.zeros(shape, dtype=precision.scalar, device=device)
        self._fill, self._evaluate = distance_kernels(precision)
        tree = wp.Mesh(
            points=wp.array(surface, dtype=wp.vec3f, device=device),
            indices=wp.array(corners.ravel(), dtype=int, device=device),
        )
        normals, rim = feature_normals(surface, corners)
        reach = 4.0 * float(np.linalg.norm(np.multiply(shape, self.spacing)))
        inputs = [
            tree.id,
            wp.array(surface, dtype=precision.vec3, device=device),
            wp.array(corners, dtype=wp.vec3i, device=device),
            wp.array(normals, dtype=precision.vec3, device=device),
            wp.array(rim, dtype=wp.bool, device=device),
            precision.scalar(self.spacing),
            precision.scalar(reach),
            self.coefficients,
        ]
        wp.launch(self._fill, dim=shape, inputs=inputs, device=device, block_dim=threads_of_block(device))
        # the tree is needed until this is done, and no longer
        wp.synchronize_device(device)
        if in_place:
            # what smoothing adds is taken from the coefficients to second order (quasi-interpolation)
            d = self.coefficients.numpy()
            curved = np.zeros_like(d)
            for axis in range(3):
                inner = tuple(slice(1, -1) if a == axis else slice(None) for a in range(3))
                curved[inner] += np.diff(d, 2, axis=axis)
            self.coefficients.assign(d - curved / 6.0)

    def at(self, points: wp.array, distances: wp.array, directions: wp.array) -> None:
        """Write distances [m] and directions away from the surface's inside at points [m]."""
        inputs = [
            points, self.coefficients, self.origin, self._precision.scalar(self.spacing), distances, directions
        ]  # fmt: skip
        block_dim = threads_of_block(self._device)
        wp.launch(self._evaluate, dim=len(points), inputs=inputs, device=self._device, block_dim=block_dim)


def _edge(points: Floats, faces: Int32s) -> float:
    """Median length [m] of the edges of triangles."""
    return float(np.median(np.linalg.norm(points[faces] - points[np.roll(faces, 1, axis=1)], axis=2)))


@cache
def _kernels(precision: Precision) -> tuple[Any, Any, Any, Any]:
    """What kernels know of a wall, and those for forces, tangent blocks, and energies with distances, by node."""
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    module = compiled_module(f"contact_{precision.name}")
    slip = wp.constant(scalar(_SLIP))
    distance = smooth_distance(precision)

    @wp.struct
    class Wall:
        nodes: wp.array[int]
        points: wp.array[vec3]
        area: wp.array[scalar]
        start: wp.array[scalar]
        coefficients: wp.array3d[scalar]
        origin: vec3
        spacing: scalar
        numbers: wp.array[scalar]
        found: wp.array[scalar]
        pressing: wp.array[scalar]
        gaps: wp.array[scalar]
        directions: wp.array[vec3]
        tractions: wp.array[vec3]

    @wp.kernel(module=module)
    def forces(w: Wall, state: int, u: wp.array[vec3], out: wp.array2d[vec3]):
        t = wp.tid()
        k = w.numbers[0]
        friction = w.numbers[1]
        d = u[w.nodes[t]]
        if state == 0:
            out[t, 0] = w.area[t] * (k * d + w.tractions[t])
            return
        g, slope, _H = distance(w.points[w.nodes[t]] + d, w.coefficients, w.origin, w.spacing)
        pressure = k * (g - w.start[t]) + w.found[t]
        if state == 2:
            pressure = wp.max(pressure, scalar(0.0))
        s = d - wp.dot(d, w.directions[t]) * w.directions[t]
        rubbing = friction * w.pressing[t] / wp.sqrt(wp.dot(s, s) + slip * slip)
        out[t, 0] = w.area[t] * (pressure * slope + rubbing * s)

    @wp.kernel(module=module)
    def tangents(w: Wall, state: int, u: wp.array[vec3], out: wp.array2d[mat33]):
        t = wp.tid()
        k = w.numbers[0]
        friction = w.numbers[1]
        identity = wp.identity(n=3, dtype=scalar)
        if state == 0:
            out[t, 0] = w.area[t] * k * identity
            return
        d = u[w.nodes[t]]
        g, slope, H = distance(w.points[w.nodes[t]] + d, w.coefficients, w.origin, w.spacing)
        pressure = k * (g - w.start[t]) + w.found[t]
        K = mat33()
        # what just touches counts as pressed: a first step that went through the wall would find no way back
        if state == 1 or pressure >= scalar(0.0):
            K = k * wp.outer(slope, slope) + pressure * H
        if friction != scalar(0.0):
            n = w.directions[t]
            s = d - wp.dot(d, n) * n
            size = wp.sqrt(wp.dot(s, s) + slip * slip)
            K += friction * w.pressing[t] / size * (identity - wp.outer(n, n) - wp.outer(s, s) / (size * size))
        out[t, 0] = w.area[t] * K

    @wp.kernel(module=module)
    def energies(w: Wall, state: int, u: wp.array[vec3], out: wp.array[scalar]):
        t = wp.tid()
        k = w.numbers[0]
        friction = w.numbers[1]
        d = u[w.nodes[t]]
        if state == 0:
            w.gaps[t] = wp.length(d)
            q = k * d + w.tractions[t]
            out[t] = scalar(0.5) * w.area[t] / k * wp.dot(q, q)
            return
        g, _slope, _H = distance(w.points[w.nodes[t]] + d, w.coefficients, w.origin, w.spacing)
        w.gaps[t] = g - w.start[t]
        pressure = k * w.gaps[t] + w.found[t]
        if state == 2:
            pressure = wp.max(pressure, scalar(0.0))
        s = d - wp.dot(d, w.directions[t]) * w.directions[t]
        rubbed = friction * w.pressing[t] * (wp.sqrt(wp.dot(s, s) + slip * slip) - slip)
        out[t] = w.area[t] * (scalar(0.5) / k * pressure * pressure + rubbed)

    return Wall, forces, tangents, energies
