"""Another compressibility than the case says."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from warpbrain.physics.expectation import Uniform
from warpbrain.physics.laws import Law
from warpbrain.physics.mechanism import Mechanism, parameter


@dataclass(frozen=True, kw_only=True)
class Compressibility(Mechanism):
    """Another Poisson ratio of all tissues.

    Parameters
    ----------
    poisson : float
        At rest, in (-1, 0.5).
    """

    poisson: float = parameter(
        "Poisson ratio at rest.",
        above=-1.0,
        below=0.5,
        expectation=Uniform(0.35, 0.4999),
        typical="0.45 to 0.4999 over seconds, 0.35 to 0.49 when fluid has had time to leave",
        source="diagnosis design, M9 and M14",
    )
    kind: ClassVar[str] = "compressibility"
    of_specimens: ClassVar[bool] = True
    sentence: ClassVar[str] = "Tissue gives way under pressure more, or less, than was assumed."
    example: ClassVar[str] = "compressibility:poisson=0.35"
    confused_with: ClassVar[tuple[str, ...]] = ("drainage", "swelling")

    def substitute(self, label: int, law: Law, poisson: float, formulation: str) -> tuple[Law, float, str]:
        """See `warpbrain.physics.mechanism.Substituting`."""
        return law, self.poisson, formulation
