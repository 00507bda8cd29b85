"""Gravity after drainage of cerebrospinal fluid: above the fluid's level tissue loses its buoyancy.

The imaged shape is the reference: it is in equilibrium while submerged. What deforms it is the *change* of load since
then (diagnosis design, mechanism M1):

    f_a = int N_a [ rho_csf g H(z(X) - level) d + (rho_tissue - rho_csf) g (d - d_imaged) ] dV

with `d` the direction of gravity, `z` the height against it above the lowest point of the undeformed mesh, and `H` the
unit step. Elements that the fluid's surface cuts are integrated exactly, and so are the derivatives by its level and by
the direction, integrals over the surface of the fluid (`warpbrain.mesh.half_space`). The second term is there only if
the head was turned since imaging: `direction` is where 'down' is in the pose of the surgery, in the axes of the image,
`imaged_direction` where it was while imaging, and either is the case's `gravity_axis` if it is not said. It is a small
difference of two densities, so it takes `tissue_density`, that of brain. The `density` of the case may be the paper's
1211.5 kg/m3, which is right for comparing inertia with it and would make the difference six times too large.

A body that hangs in air, and was free of gravity when its shape was taken, has its full weight, of the case's density.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import InputError
from warpbrain.mesh import QuadraticMesh, TetMesh, integrals_above, integrals_of_shapes, integrals_on_plane, tangents
from warpbrain.mesh.quality import SAME_PLACE, extent
from warpbrain.physics.load import Along, BodyForce
from warpbrain.physics.mechanism import Expectation, Facts, Mechanism, ParameterError, parameter
from warpbrain.physics.potential import Enters
from warpbrain.physics.proposal import Proposal, Situation
from warpbrain.physics.regions import unit_vector
from warpbrain.physics.words import Values, measured, towards, vector_in

#: Standard gravity [m/s2] as used by the verification cases of this project.
STANDARD_GRAVITY = 9.81
#: Density of cerebrospinal fluid [kg/m3]; about 1.007 g/cm3 at body temperature (Davson and Segal 1996).
CSF_DENSITY = 1007.0
#: Density of brain [kg/m3], grey and white matter (ICRU Report 44, 1989).
BRAIN_DENSITY = 1040.0
#: Where it is looked for: levels, standard deviation of how much of the weight acts, and of the head's pose [rad].
_LEVELS, _SHARE, _POSE = 9, 0.1, 0.12
#: Standard deviation of a level that changes, of the height of the body.
_FALL = 0.2
#: Part of the height of the body up to which a level leaves no fluid.
_LOW = 0.01


@dataclass(frozen=True, kw_only=True)
class Gravity(BodyForce, Mechanism):
    """Weight that acts on tissue above the level of the cerebrospinal fluid.

    Without a level there never was any fluid, and the reference is free of gravity, as a gel phantom on the bench: the
    full weight acts. Levels are counted from the height `lowest` [m], ``-x . direction``; None: of the lowest node.
    """

    direction: tuple[float, float, float] = parameter(
        "Where 'down' is while it acts.",
        kind="vector",
        absent="[case] gravity_axis",
        typical="from prone to supine the brain moves by 0.5 to 0.8 mm",
        source="Zappala et al. 2021 (diagnosis design, M1)",
    )
    imaged_direction: tuple[float, float, float] | None = parameter(
        "Where 'down' was while the anatomy was imaged.", kind="vector", default=None, absent="[case] gravity_axis"
    )
    density: float = parameter(
        "Density of what has its full weight, in air.", unit="kg/m3", above=0.0, absent="[body] density", method=True
    )
    tissue_density: float = parameter(
        "Density of the tissue that the fluid carries, for the load of a turned head.",
        default=BRAIN_DENSITY,
        unit="kg/m3",
        above=0.0,
        typical="1030 to 1050 kg/m3",
        source="ICRU Report 44 (1989): brain, grey and white matter 1040 kg/m3",
    )
    csf_level: float | None = parameter(
        "Height of the fluid's surface against gravity, above the lowest point of the anatomy.",
        default=None,
        absent="needed in fluid, and nothing in air",
        unit="mm",
        si=1e-3,
        expectation=Expectation.uniform(0.0, 160.0),
        typical="the brain sinks by 5.7 mm in the mean, by 15 mm at most at the end of surgery",
        source="Miga et al. 1999; Davson and Segal 1996 (density of the fluid)",
    )
    surroundings: str = parameter(
        "What is around the body: cerebrospinal fluid that drains to a level, or air, where all of it has its weight.",
        kind="text",
        default="fluid",
        choices=("fluid", "air"),
    )
    lowest: float | None = None
    kind: ClassVar[str] = "gravity"
    quadratic: ClassVar[bool] = True
    confused_with: ClassVar[tuple[str, ...]] = ("pressure", "swelling")
    enters: ClassVar[Enters] = Enters("weight", "f_gravity")
    together: ClassVar[Mapping[str, str]] = {
        "cavity": "What has been taken out weighs nothing.",
        "resection": "Levels are counted from the lowest point of the whole anatomy.",
    }
    sentence: ClassVar[str] = "The body sinks under weight that no fluid carries, in air or where fluid has drained."
    example: ClassVar[str] = "gravity:level=130"

    def __post_init__(self) -> None:
        super().__post_init__()
        unit_vector("direction", self.direction)
        if self.imaged_direction is not None:
            unit_vector("imaged_direction", self.imaged_direction)
        if self.csf_level is not None and not np.isfinite(self.csf_level):
            raise InputError(f"gravity: csf_level = {self.csf_level}: expected a finite height")
        if self.csf_level is None:
            object.__setattr__(self, "surroundings", "air")
        elif self.surroundings == "air":
            raise ParameterError("csf_level", "means nothing in air, where all has its weight")

    @classmethod
    def of_case(cls, values: Mapping[str, Any], facts: Facts) -> Gravity:
        axis = facts.gravity_axis or values.get("direction")
        if axis is None:
            raise ParameterError("gravity_axis", "missing, but [[mechanism]] gravity needs to know where 'down' is")
        if "csf_level" not in values and values.get("surroundings") != "air":
            raise ParameterError("csf_level", "missing: expected a finite number [mm], or surroundings = 'air'")
        parameters: dict[str, Any] = {"direction": axis, "imaged_direction": axis, **values}
        # counted from the whole anatomy: a resection must not move the datum
        lowest = float((-facts.mesh.points @ unit_vector("direction", parameters["direction"])).min())
        return cls(**{"density": facts.density, "lowest": lowest, **parameters})

    def in_case(self, facts: Facts) -> dict[str, Any]:
        """See `warpbrain.physics.mechanism.Mechanism`; a file counts levels from the whole anatomy's lowest point."""
        values = super().in_case(facts)
        if self.imaged_direction is None:
            values["imaged_direction"] = self.direction
        if self.density == facts.density:
            del values["density"]
        if self.csf_level is not None:
            lowest = self.datum(facts.left)
            values["csf_level"] = self.csf_level + (lowest - float((facts.mesh.points @ self._up).min()))
        return values

    @classmethod
    def proposals(cls, situation: Situation) -> Sequence[Proposal]:
        """Levels of the fluid, with the head's pose known to some degrees; any direction if it is not known at all.

        A body that is stiffer than brain is no head: it is in air, and has its whole weight.
        """
        points = situation.mesh.points
        if situation.gravity_axis is None:

            def anywhere(c: Floats) -> Gravity:
                share = float(np.linalg.norm(c))
                direction = tuple((c if share else np.array([0.0, 0.0, -1.0])).tolist())
                return cls(direction=direction, density=CSF_DENSITY, ramp=((0.0, share),))

            return [Proposal(anywhere, np.zeros(3), np.full(3, 0.5), region="all tissue")]
        down = unit_vector("gravity_axis", situation.gravity_axis)
        depths = points @ down
        height = float(np.ptp(depths))
        # of a head that is tilted another point is the lowest one, and at once where the body is flat there: levels are
        # counted from this one, whose height has a derivative in every direction
        deepest = points[depths >= depths.max() - SAME_PLACE * extent(points)].mean(axis=0)
        across = tangents(down)
        sd, usual = np.array([_SHARE, _POSE, _POSE]), np.array([1.0, 0.0, 0.0])

        def hanging(c: Floats, **fluid: Any) -> Gravity:
            direction = tuple((down + c[1] * across[0] + c[2] * across[1]).tolist())
            return cls(direction=direction, density=situation.density, ramp=((0.0, float(c[0])),), **fluid)

        if situation.stiffness > 1.0 and cls.kind not in situation.assumed:
            return [Proposal(hanging, usual, sd, "smooth", usual, np.zeros(3), odds="causes.weight")]
        over_time: dict[str, Any] = {"varying": (3,), "in_turns": True, "only_over_time": True}
        proposals = []
        for level in np.linspace(-0.05, 0.9, _LEVELS) * height:

            def drained(c: Floats, middle: float = float(level)) -> Gravity:
                lowest = float(deepest @ hanging(c)._up)
                return hanging(c, csf_level=middle + (float(c[3]) if len(c) > 3 else 0.0), lowest=lowest)

            proposals.append(Proposal(drained, usual, sd, "smooth", usual, np.zeros(3)))
            falling, at_first = np.append(sd, _FALL * height), np.append(usual, 0.0)
            proposals.append(Proposal(drained, at_first, falling, "smooth", at_first, np.zeros(4), **over_time))
        return proposals

    @classmethod
    def size_in_words(cls, values: Values, gravity_axis: tuple[float, float, float] | None = None) -> Sequence[str]:
        clauses = []
        if "csf_level" in values:
            level = values["csf_level"]
            clauses.append(
                f"the fluid's surface is {measured(level.value, level.sd, 'mm')} above the lowest point of the anatomy"
            )
        names = [f"direction_{letter}" for letter in "xyz"]
        spreads = [values[name].sd for name in names if name in values]
        down = vector_in(values, "direction")
        if gravity_axis is not None:
            # a component that is not known better than beforehand is where it was
            declared = unit_vector("gravity_axis", gravity_axis)
            down = np.where([name in values for name in names], down, declared)
        if "share" in values:
            share = values["share"]
            where = towards(math.copysign(1.0, share.value) * down)
            part = measured(100.0 * share.value, 100.0 * share.sd)
            clauses.append(f"{part} % of that weight acts{f', {where}' if where else ''}")
        elif down.any():
            clauses.append(f"its weight acts {towards(down)}")
        if gravity_axis is not None and spreads:
            across = down - (down @ declared) * declared
            degrees = math.degrees(math.atan2(float(np.linalg.norm(across)), float(down @ declared)))
            spread = math.degrees(math.hypot(*spreads))
            where = f" {towards(across)}" if degrees > spread else ""
            clauses.append(f"'down' is tilted by {measured(degrees, spread)} degrees{where} from what was declared")
        return clauses

    def detail(self) -> str:
        if self.csf_level is None:
            return ""
        axis = ", ".join(f"{v:g}" for v in self.direction)
        text = f" Its level: {1000.0 * self.csf_level:g} mm above the lowest point; gravity along ({axis}) in RAS"
        down = unit_vector("direction", self.direction)
        imaged = down if self.imaged_direction is None else unit_vector("imaged_direction", self.imaged_direction)
        turned = float(np.degrees(np.arctan2(np.linalg.norm(np.cross(down, imaged)), down @ imaged)))
        if turned < 0.05:
            return f"{text}."
        tissue = f"of tissue of {self.tissue_density:g} kg/m3"
        return f"{text}, {turned:.1f} degrees from where it was while imaged, {tissue}."

    def with_body_turned(self, rotation: Floats) -> Gravity:
        """See `warpbrain.physics.mechanism.Mechanism`; levels are counted from what is the lowest point then."""
        direction = tuple((rotation.T @ np.array(self.direction)).tolist())
        return dataclasses.replace(self, direction=direction, lowest=None)

    def doubt(self, mesh: TetMesh) -> str:
        height = float(np.ptp(mesh.points @ self._up))
        if self.csf_level is None or _LOW * height < self.csf_level < height:
            return ""
        what = "floats" if self.csf_level > 0.5 * height else "has its weight"
        of = f"all of a body {1e3 * height:.3g} mm high {what}"
        return f"csf_level = {1e3 * self.csf_level:g} mm: {of}: is the unit right?"

    def datum(self, mesh: TetMesh | QuadraticMesh) -> float:
        """Height [m], `-x . direction`, of the point that levels are counted from."""
        return float((mesh.points @ self._up).min()) if self.lowest is None else self.lowest

    def unit_forces(self, mesh: TetMesh | QuadraticMesh) -> Floats:
        whole = integrals_of_shapes(mesh)[:, :, None]
        if self.csf_level is None:
            return -self.density * STANDARD_GRAVITY * whole * self._up
        dry = integrals_above(mesh, self._up, self.datum(mesh) + self.csf_level)[:, :, None]
        force = -CSF_DENSITY * STANDARD_GRAVITY * dry * self._up
        if self.imaged_direction is not None:
            force = force + (self.tissue_density - CSF_DENSITY) * STANDARD_GRAVITY * whole * self._turned
        return force

    def nodal_forces(self, mesh: TetMesh | QuadraticMesh) -> Floats:
        corners = mesh if isinstance(mesh, TetMesh) else mesh.corners
        return corners.made_once((type(mesh), repr(self)), lambda: super(Gravity, self).nodal_forces(mesh))

    def unit_forces_rate(self, mesh: TetMesh | QuadraticMesh, along: Along) -> Floats:
        whole = integrals_of_shapes(mesh)[:, :, None]
        up_rate = along(lambda gravity: gravity._up)
        if self.csf_level is None:
            return -self.density * STANDARD_GRAVITY * whole * up_rate
        surface = self.datum(mesh) + self.csf_level
        surface_rate = along(lambda gravity: np.asarray(gravity.datum(mesh) + gravity.csf_level))
        # the surface of the fluid sinks through the tissue by so much [m]
        sunk = integrals_on_plane(mesh, self._up, surface, lambda points: points @ up_rate - surface_rate)
        dry = integrals_above(mesh, self._up, surface)
        rate = -CSF_DENSITY * STANDARD_GRAVITY * (sunk[:, :, None] * self._up + dry[:, :, None] * up_rate)
        if self.imaged_direction is not None:
            turned_rate = along(lambda gravity: (gravity.tissue_density - CSF_DENSITY) * gravity._turned)
            rate = rate + STANDARD_GRAVITY * whole * turned_rate
        return rate

    @property
    def _up(self) -> Floats:
        return -unit_vector("direction", self.direction)

    @property
    def _turned(self) -> Floats:
        """Direction of gravity less that while imaged."""
        assert self.imaged_direction is not None
        return -self._up - unit_vector("imaged_direction", self.imaged_direction)
