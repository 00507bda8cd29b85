"""A region that is stiffer or softer than the tissue around it: a tumour, a scar.

All moduli of an element are multiplied by `exp(s w)`, `w` how much it belongs to the region and `exp(s)` the ratio:
those of its law, of fibres and of viscosity. A residual stress is no modulus.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.mesh import TetMesh
from warpbrain.physics.mechanism import Expectation, Mechanism, parameter
from warpbrain.physics.potential import Enters
from warpbrain.physics.proposal import Proposal, Situation
from warpbrain.physics.regions import region_weights
from warpbrain.physics.words import Smallest, Values, measured, number

#: Where it is looked for: standard deviation of the logarithm of the ratio, and radii of balls over
#: that of the body, 12 to 27 mm of a brain.
_USUAL, _RADII = 1.2, (0.185, 0.277, 0.415)


@dataclass(frozen=True, kw_only=True)
class Inclusion(Mechanism):
    """Another stiffness in an element set or a ball."""

    ratio: float = parameter(
        "Of its moduli to those of the tissue around.",
        above=0.0,
        expectation=Expectation.log_normal(1.0, 3.3),
        typical="glioblastoma 0.86 in the mean, 5 of 22 stiffer; meningioma stiffest",
        source="elastography of tumours (diagnosis design, M11)",
    )
    elements: str = parameter("Element set of it.", default="", kind="element set", absent="a ball or all tissue")
    centre: tuple[float, float, float] | None = parameter("Centre of a ball.", default=None, kind="position")
    radius: float | None = parameter(
        "Its radius.", default=None, unit="mm", si=1e-3, above=0.0, told=("its radius is {}",)
    )
    kind: ClassVar[str] = "inclusion"
    enters: ClassVar[Enters] = Enters("moduli", "r")
    together: ClassVar[Mapping[str, str]] = {
        "compressibility": "The ratio multiplies both moduli, so the Poisson ratio is the new one inside too.",
        "cavity": "What is left of the tissue keeps its ratio.",
        "gravity": "Stiffer tissue is not heavier.",
        "inclusion": "Where regions overlap their ratios multiply.",
    }
    sentence: ClassVar[str] = "A part of the tissue is stiffer or softer than the rest."
    example: ClassVar[str] = "inclusion:ratio=10,elements=ball"
    confused_with: ClassVar[tuple[str, ...]] = ("swelling",)
    several: ClassVar[bool] = True

    @classmethod
    def proposals(cls, situation: Situation) -> Sequence[Proposal]:
        """Balls of two sizes throughout the tissue; the coefficient is the logarithm of the ratio."""
        return Proposal.in_balls(
            lambda s, centre, radius: cls(ratio=math.exp(s), centre=centre, radius=radius), _USUAL, _RADII, situation
        )

    @classmethod
    def size_in_words(cls, values: Values, gravity_axis: tuple[float, float, float] | None = None) -> Sequence[str]:
        others = super().size_in_words({name: value for name, value in values.items() if name != "ratio"})
        if "ratio" not in values or not values["ratio"].value > 0.0:
            return others
        ratio = values["ratio"]
        times, word = (ratio.value, "stiff") if ratio.value >= 1.0 else (1.0 / ratio.value, "soft")
        spread = times * ratio.sd / ratio.value
        return [f"it is {measured(times, spread)} times as {word} as the tissue around", *others]

    @classmethod
    def smallest_in_words(cls, smallest: Smallest) -> str:
        if smallest.name != "ratio":
            return super().smallest_in_words(smallest)
        return f"from {number(1.0 + smallest.size)} times the stiffness around it"

    def check(self, mesh: TetMesh) -> None:
        super().check(mesh)
        region_weights(mesh, self.elements, self.centre, self.radius)

    def stiffness_factor(self, mesh: TetMesh, scale: float) -> Floats:
        """See `warpbrain.physics.mechanism.Weakening`; a stiffness is there from the start, whatever the load."""
        weights = region_weights(mesh, self.elements, self.centre, self.radius)
        return np.exp(self.factor() * np.log(self.ratio) * weights)
