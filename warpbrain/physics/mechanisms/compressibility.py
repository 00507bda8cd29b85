"""Another compressibility than the case says."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from warpbrain.physics.laws import Law
from warpbrain.physics.mechanism import Expectation, Mechanism, parameter
from warpbrain.physics.potential import Enters
from warpbrain.physics.proposal import NotTestableError, Proposal, Situation, Tests


@dataclass(frozen=True, kw_only=True)
class Compressibility(Mechanism):
    """Another Poisson ratio of all tissues."""

    poisson: float = parameter(
        "Poisson ratio at rest.",
        above=-1.0,
        below=0.5,
        expectation=Expectation.uniform(0.35, 0.4999),
        typical="0.45 to 0.4999 over seconds, 0.35 to 0.49 when fluid has had time to leave",
        source="diagnosis design, M9 and M14",
    )
    kind: ClassVar[str] = "compressibility"
    of_specimens: ClassVar[bool] = True
    enters: ClassVar[Enters] = Enters("law", "nu")
    sentence: ClassVar[str] = "Tissue gives way under pressure more, or less, than was assumed."
    example: ClassVar[str] = "compressibility:poisson=0.35"
    confused_with: ClassVar[tuple[str, ...]] = ("drainage", "swelling")
    always: ClassVar[str] = "tissue.volume"

    @classmethod
    def proposals(cls, situation: Situation) -> Sequence[Proposal]:
        """Another ratio."""
        situation.require_new(cls.kind)
        return [cls.about_law(situation.poisson, 1.2)]

    @classmethod
    def about_law(cls, poisson: float, sd: float) -> Proposal:
        """See `warpbrain.physics.mechanism.Mechanism`; of `-ln(1 - 2 nu)`, in which bulk moduli are even steps."""
        coordinate = -math.log1p(-2.0 * poisson)
        return Proposal.of_one(
            lambda c: cls(poisson=-0.5 * math.expm1(-c)), coordinate, sd, "smooth", coordinate, region="all tissue"
        )

    @classmethod
    def check_tests(cls, tests: Tests) -> None:
        if "confined" not in tests.modes or tests.loads < 2:
            raise NotTestableError("needs confined compression and another test, so that the volume changes in one")

    def substitute(self, label: int, law: Law, poisson: float, formulation: str) -> tuple[Law, float, str]:
        return law, self.poisson, formulation
