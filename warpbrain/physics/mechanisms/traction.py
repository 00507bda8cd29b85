"""Traction on a patch of the surface: a retractor, an instrument, a dressing.

    f_a = t int N_a w(|X - c| / R) dA,    w(r) = 1/2 (1 + cos(pi r)) for r < 1, else 0

on the reference surface; `t` keeps its direction (a dead load). Of the surface within the radius it acts on one piece:
what hangs together with the point nearest to the centre and faces the same way as there
(`warpbrain.mesh.patches.patch_around`), not the far side of a thin body, nor a ventricle's wall below.

What hangs on an edge or pulls at points has no area: the nodes of a set share its force evenly.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import ClassVar

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.mesh import QuadraticMesh, TetMesh, patch_around, surface_forces
from warpbrain.physics.load import Load, NodalForce
from warpbrain.physics.mechanism import Expectation, Mechanism, ParameterError, parameter
from warpbrain.physics.potential import Enters
from warpbrain.physics.proposal import Proposal, Situation
from warpbrain.physics.regions import elements_with, unit_vector
from warpbrain.physics.words import HARDLY, Values, measured, name_of_set, towards, unsure, vector_in

#: Where it is looked for: radii of patches over that of the body, 9 and 14 mm of a brain, and standard deviation of
#: each component on brain [Pa].
_RADII, _USUAL = (0.138, 0.215), 1000.0
#: Force on brain [N] over the square of the radius of the body: of that traction on the larger patch,
#: `pi (1/2 - 2/pi^2)` times the square of its radius.
_USUAL_FORCE = _USUAL * math.pi * (0.5 - 2.0 / math.pi**2) * max(_RADII) ** 2
#: Radius [m] if a case gives none.
_RADIUS = 0.010
#: Patches whose nodes are kept, the latest ones.
_KEPT = 1024


@dataclass(frozen=True, kw_only=True)
class Traction(Load, Mechanism):
    """A traction around a point of the surface, or a force on nodes."""

    centre: tuple[float, float, float] | None = parameter(
        "Point of the surface around which it acts.", default=None, kind="position"
    )
    value: tuple[float, float, float] | None = parameter(
        "Traction at the centre.",
        default=None,
        kind="vector",
        unit="Pa",
        typical="0 to 10 kPa (75 mmHg) under retractors; damage from 2.7 to 4 kPa",
        source="120 recordings in 23 patients (diagnosis design, M3)",
    )
    radius: float | None = parameter(
        "Distance at which it has fallen to zero.",
        default=None,
        absent="10 with a centre",
        unit="mm",
        si=1e-3,
        above=0.0,
        expectation=Expectation.uniform(5.0, 15.0),
        told=("its radius is {}",),
    )
    nodes: str = parameter("Node set that shares a force, in the place of a patch.", default="", kind="node set")
    force: tuple[float, float, float] | None = parameter(
        "That force, shared evenly.", default=None, kind="vector", unit="N"
    )
    kind: ClassVar[str] = "traction"
    quadratic: ClassVar[bool] = True
    enters: ClassVar[Enters] = Enters("load", "f_traction")
    together: ClassVar[Mapping[str, str]] = {
        "resection": "It acts on what the surface of what is left has within the radius.",
        "swelling": "The force is that on the imaged surface: it does not grow with it.",
        "traction": "Where patches overlap their tractions add.",
    }
    sentence: ClassVar[str] = "Something presses or pulls on a patch of the surface, such as a retractor."
    example: ClassVar[str] = "traction:centre=58/-17/50,value=-500/0/-500,radius=15"
    confused_with: ClassVar[tuple[str, ...]] = ("contact", "pressure")
    several: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.nodes:
            others = ("centre", "value", "radius")
            given = next((name for name in others if getattr(self, name) is not None), None)
            if given is not None:
                raise ParameterError(given, "given beside nodes: it acts on a patch or on a node set")
            if self.force is None:
                raise ParameterError("force", "missing: expected what the nodes share [N]")
            return
        if self.force is not None:
            raise ParameterError("nodes", "missing: expected the node set that shares the force")
        for name in ("centre", "value"):
            if getattr(self, name) is None:
                raise ParameterError(name, f"missing: {self.parameters()[name].doc[:-1].lower()}")
        if self.radius is None:
            object.__setattr__(self, "radius", _RADIUS)

    def check(self, mesh: TetMesh) -> None:
        super().check(mesh)
        if self.value is not None and any(self.value) and not self.nodal_forces(mesh).any():
            raise ParameterError("centre", "no face of the surface lies within the radius of this point")

    def acts_on(self, mesh: TetMesh) -> Bools:
        if self.nodes:
            return np.asarray(mesh.node_sets[self.nodes][mesh.tetrahedra].any(axis=1))
        assert self.centre is not None and self.radius is not None
        return elements_with(mesh, mesh.boundary[patch_around(mesh.points, mesh.boundary, self.centre, self.radius)])

    @classmethod
    def proposals(cls, situation: Situation) -> Sequence[Proposal]:
        """Patches of two sizes all over the free surface; and what hangs on edges and points that a case declares."""
        pulling = partial(cls._pulling, situation)
        radii = [part * situation.mesh.radius for part in _RADII]
        patches = [pulling(site, radius) for site in situation.surface_sites for radius in radii]
        sd = _USUAL_FORCE * situation.mesh.radius**2 * situation.stiffness
        # any force where nobody says where 'down' is
        down = situation.gravity_axis
        axes = np.eye(3) if down is None else unit_vector("gravity_axis", down)[None]
        return [*patches, *(cls._shared(nodes, axes, sd) for nodes in situation.unused)]

    @classmethod
    def size_in_words(cls, values: Values, gravity_axis: tuple[float, float, float] | None = None) -> Sequence[str]:
        name = next((name for name in ("value", "force") if f"{name}_size" in values), None)
        if name is None:
            return super().size_in_words(values)
        size = values[f"{name}_size"]
        where = f"in a direction {HARDLY}" if unsure(size) else towards(vector_in(values, name))
        acts = f"it acts with {measured(size.value, size.sd, size.unit)} {where}".rstrip()
        return [acts, *super().size_in_words(values)]

    @classmethod
    def _pulling(cls, situation: Situation, site: Floats, radius: float) -> Proposal:
        x, y, z = site.tolist()
        return Proposal(
            lambda c: cls(centre=(x, y, z), value=tuple(c.tolist()), radius=radius),
            np.zeros(3),
            np.full(3, _USUAL * situation.stiffness),
            elsewhere=partial(cls._pulling, situation),
            on_surface=True,
            centre=site,
            radius=radius,
            radii=(min(_RADII) * situation.mesh.radius, max(_RADII) * situation.mesh.radius),
            region=situation.surface_at(site),
            varying=(0, 1, 2),
        )

    @classmethod
    def _shared(cls, nodes: str, axes: Floats, sd: float) -> Proposal:
        """On a node set, with a coefficient [N] along each of some axes (k, 3)."""
        return Proposal(
            lambda c: cls(nodes=nodes, force=tuple((c @ axes).tolist())),
            np.zeros(len(axes)),
            np.full(len(axes), sd),
            region=name_of_set(nodes),
            declared=True,
            varying=tuple(range(len(axes))),
        )

    def nodal_forces(self, mesh: TetMesh | QuadraticMesh) -> Floats:
        if self.force is not None:
            return NodalForce(nodes=self.nodes, total=self.force).nodal_forces(mesh)
        assert self.centre is not None and self.radius is not None and self.value is not None
        nodes, areas = _patch(mesh, tuple(map(float, self.centre)), float(self.radius))
        forces = np.zeros(mesh.points.shape)
        forces[nodes] = np.outer(areas, self.value)
        return forces


@lru_cache(maxsize=_KEPT)
def _patch(mesh: TetMesh | QuadraticMesh, centre: tuple[float, ...], radius: float) -> tuple[Ints, Floats]:
    """Nodes of a patch, and areas [m2] with which a traction at its centre acts on them: a scan asks for them often."""
    corners = mesh if isinstance(mesh, TetMesh) else mesh.corners
    triangles = patch_around(corners.points, corners.boundary, centre, radius)

    def profile(points: Floats) -> Floats:
        away = np.minimum(np.linalg.norm(points - np.array(centre), axis=1) / radius, 1.0)
        weights = np.zeros(points.shape)
        weights[:, 0] = 0.5 * (1.0 + np.cos(np.pi * away))
        return weights

    areas = surface_forces(mesh, profile, triangles)[:, 0]
    nodes = np.flatnonzero(areas)
    return nodes, areas[nodes]
