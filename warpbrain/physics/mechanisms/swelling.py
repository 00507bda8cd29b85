"""Swelling or shrinkage: tissue would have another volume if nothing held it.

`F = F_e F_g` with `F_g = (1 + g)^(1/3) I`; only `F_e` makes stress (Rodriguez et al. 1994), in the law
(`warpbrain.physics.laws.device`), in fibres, in viscosity: swelling that nothing holds makes none.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from warpbrain.arrays import Floats
from warpbrain.mesh import TetMesh
from warpbrain.physics.mechanism import Changed, Expectation, Mechanism, parameter
from warpbrain.physics.potential import Enters
from warpbrain.physics.proposal import Proposal, Situation
from warpbrain.physics.regions import region_weights

#: Where it is looked for: usual standard deviation of the change everywhere and in a ball, which may be 2.5 times as
#: large (mannitol takes 5 %, oedema adds up to 30 %: `amount`), and radii of balls over that of the body, 12 to 27 mm
#: of a brain.
_EVERYWHERE, _SOMEWHERE, _RADII = 0.03, 0.05, (0.185, 0.277, 0.415)


@dataclass(frozen=True, kw_only=True)
class Swelling(Mechanism):
    """A change of volume of all tissue, of an element set or of a ball."""

    amount: float = parameter(  # `g`
        "Relative change of volume where nothing holds the tissue; negative shrinks.",
        unit="%",
        si=1e-2,
        above=-90.0,
        below=400.0,
        expectation=Expectation.normal(0.0, 3.0),
        typical="mannitol takes 5 % of the water of white matter; oedema adds up to 30 %",
        source="diagnosis design, M7",
        told=("it swells by {} of its volume", "it shrinks by {} of its volume", "it grows by {} of its volume"),
    )
    elements: str = parameter("Element set that swells.", default="", kind="element set", absent="a ball or all tissue")
    centre: tuple[float, float, float] | None = parameter("Centre of a ball.", default=None, kind="position")
    radius: float | None = parameter(
        "Its radius.", default=None, unit="mm", si=1e-3, above=0.0, told=("its radius is {}",)
    )
    kind: ClassVar[str] = "swelling"
    of_specimens: ClassVar[bool] = True
    enters: ClassVar[Enters] = Enters("growth", "g")
    changes: ClassVar[Changed] = "volumes"
    together: ClassVar[Mapping[str, str]] = {
        "inclusion": "The moduli are those of the swollen tissue.",
        "cavity": "What swells is what is left.",
        "gravity": "Tissue weighs what it did when it was imaged: water that comes or goes is not weighed.",
        "swelling": "Where regions overlap one grows what the other has grown.",
    }
    sentence: ClassVar[str] = "Tissue takes up or loses water, and swells or shrinks."
    example: ClassVar[str] = "swelling:amount=20,elements=ball"
    confused_with: ClassVar[tuple[str, ...]] = ("pressure", "gravity")
    several: ClassVar[bool] = True

    @classmethod
    def proposals(cls, situation: Situation) -> Sequence[Proposal]:
        """All tissue, or balls of two sizes throughout it."""
        everywhere = Proposal.of_one(
            lambda g: cls(amount=g), 0.0, _EVERYWHERE, "smooth", region="all tissue", varying=(0,)
        )
        balls = Proposal.in_balls(
            lambda g, centre, radius: cls(amount=g, centre=centre, radius=radius),
            _SOMEWHERE,
            _RADII,
            situation,
            varying=(0,),
        )
        return [everywhere, *balls]

    def check(self, mesh: TetMesh) -> None:
        super().check(mesh)
        region_weights(mesh, self.elements, self.centre, self.radius)

    def growth(self, mesh: TetMesh, scale: float) -> Floats:
        return scale * self.amount * region_weights(mesh, self.elements, self.centre, self.radius)
