"""A cavity that opens: tissue is taken out little by little, and fluid presses on its wall.

The elements of the set stay, with their moduli, weight and mass multiplied by `1 - s (1 - r)`, `s` from 0 to 1 over the
load and `r` what is left of them. What is taken out has the velocity that it had, so it does not push what stays. No
element turns inside out, so walls that meet lean on each other through what is left between them: the contact through
a third medium of Wriggers, Schroeder and Schwarz (2013).

A fluid at the pressure `p` presses on the wall, the faces between the set and the tissue that stays, and follows it:
the load of `pressure` on the wall of a `resection`, which is the limit for `r` to 0. A set that reaches the surface of
the body has an open wall, and the faces of the set on that surface carry nothing: what closes the opening (skull,
dura, a dressing) bears the fluid there. What the rim of an open wall does is said in `pressure`: if it moves, the load
has no energy, and linear solvers leave out the skew part of the tangent along it.

What other mechanisms add to the law of these elements (fibres, residual stress, viscosity) is taken out with them. What
acts on them (a pressure or a traction on their faces, fluid in their pores) would act on nothing, and is refused.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from warpbrain.arrays import Floats, Int32s
from warpbrain.mesh import TetMesh, interface_faces
from warpbrain.physics.mechanism import Expectation, Mechanism, ParameterError, parameter
from warpbrain.physics.mechanisms.pressure import PressureTerm
from warpbrain.physics.potential import Enters
from warpbrain.physics.proposal import NotTestableError, Proposal, Situation
from warpbrain.physics.term import Body


@dataclass(frozen=True, kw_only=True)
class Cavity(Mechanism):
    """Tissue of an element set that is taken out gradually."""

    elements: str = parameter("Element set that is taken out.", default="resection", kind="element set")
    pressure: float = parameter(
        "Pressure of the fluid on the wall of the cavity, relative to that on the rest of the surface.",
        default=0.0,
        unit="Pa",
        expectation=Expectation.normal(0.0, 200.0),
        typical="hydrostatic: 10 Pa for each mm of fluid",
        source="diagnosis design, M6",
    )
    left: float = parameter(
        "Part of its stiffness and weight that is left, through which walls that meet lean on each other.",
        default=1e-4,
        above=0.0,
        below=1.0,
        method=True,
    )
    kind: ClassVar[str] = "cavity"
    quadratic: ClassVar[bool] = True
    enters: ClassVar[Enters] = Enters("part", "c", fills="W_cavity")
    sentence: ClassVar[str] = "Tissue is taken out little by little, and the walls of the cavity move in."
    example: ClassVar[str] = "cavity:elements=ball"
    confused_with: ClassVar[tuple[str, ...]] = ("inclusion", "swelling")
    switches: ClassVar[bool] = True

    @classmethod
    def proposals(cls, situation: Situation) -> Sequence[Proposal]:
        """The element set 'resection', if it is still there."""
        situation.require_new(cls.kind)
        if "resection" not in situation.mesh.element_sets or not situation.mesh.element_sets["resection"].any():
            raise NotTestableError("needs an element set 'resection' of tissue that is still there")
        return [Proposal.switch(cls(), 0.3, region="resection")]

    def check(self, mesh: TetMesh) -> None:
        super().check(mesh)
        self.wall(mesh)

    def wall(self, mesh: TetMesh) -> Int32s:
        """Triangles (k, 3) between the set and the tissue that stays, oriented into the cavity."""
        faces = interface_faces(mesh.tetrahedra, mesh.element_sets[self.elements])
        if not len(faces):
            raise ParameterError(
                "elements", f"element set '{self.elements}' touches no tissue that stays, so a cavity there has no wall"
            )
        return faces

    def stiffness_factor(self, mesh: TetMesh, scale: float) -> Floats:
        return self.remaining_part(mesh, scale)

    def remaining_part(self, mesh: TetMesh, scale: float) -> Floats:
        return np.where(mesh.element_sets[self.elements], 1.0 - scale * (1.0 - self.left), 1.0)

    def excludes(self, other: Mechanism, mesh: TetMesh) -> str:
        emptied = mesh.element_sets.get(self.elements)
        if emptied is None or not (other.acts_on(mesh) & emptied).any():
            return ""
        return (
            f"{other.kind} acts on tissue of the element set '{self.elements}', of which the cavity leaves nothing: "
            "leave it out there, or take the tissue out by a resection"
        )

    @classmethod
    def excluded(cls, other: type[Mechanism]) -> str:
        if other.acts_on is Mechanism.acts_on:
            return ""
        return f"where {other.kind} acts on tissue that the cavity takes out: nothing would be left to act on"

    def bind(self, body: Body) -> PressureTerm:
        return PressureTerm(body, self.wall(body.mesh), self.pressure, self.factor)
