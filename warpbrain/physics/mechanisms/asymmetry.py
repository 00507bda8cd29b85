"""Tissue that resists compression otherwise than tension: Ogden's law of one term in the place of the case's own.

    Psi = (2 mu0 / alpha^2) (sum_i l_i^alpha - 3) + ...      of the same shear modulus at rest

An exponent of 2 is the neo-Hookean law; a negative one stiffens in compression.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from warpbrain.physics.laws import Law
from warpbrain.physics.laws.ogden import NEO_HOOKEAN, Ogden
from warpbrain.physics.mechanism import Expectation, Mechanism, ParameterError, parameter
from warpbrain.physics.potential import Enters
from warpbrain.physics.proposal import NotTestableError, Proposal, Situation, Tests
from warpbrain.physics.words import Values, measured


@dataclass(frozen=True, kw_only=True)
class Asymmetry(Mechanism):
    """Tension-compression asymmetry of all tissues."""

    exponent: float = parameter(  # `alpha`
        "Ogden's exponent; 2 is the neo-Hookean law, a negative one stiffens in compression.",
        expectation=Expectation.normal(2.0, 15.0),
        typical="-24 to -17 in specimens, -19 in vivo, -4.7 in the classic test",
        source="Budday et al. 2017; Bennion et al. 2022; Miller and Chinzei 2002 (diagnosis design, M12)",
    )
    kind: ClassVar[str] = "asymmetry"
    of_specimens: ClassVar[bool] = True
    enters: ClassVar[Enters] = Enters("law", "alpha")
    together: ClassVar[Mapping[str, str]] = {"compressibility": "Each says a part of the law, in any order."}
    sentence: ClassVar[str] = "Tissue resists compression otherwise than tension."
    example: ClassVar[str] = "asymmetry:exponent=-20"
    confused_with: ClassVar[tuple[str, ...]] = ("fibres",)
    always: ClassVar[str] = "tissue.exponent"
    needs: ClassVar[tuple[str, ...]] = ("regions or tests both in compression and in tension",)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.exponent == 0.0:
            raise ParameterError("exponent", "found 0, which has no energy")

    @classmethod
    def proposals(cls, situation: Situation) -> Sequence[Proposal]:
        """Another exponent than the neo-Hookean law's."""
        situation.require_new(cls.kind)
        if "ogden" in situation.laws:
            raise NotTestableError("the law of a tissue has an exponent of its own, which is refitted")
        return [cls.about_law(situation.poisson, 15.0)]

    @classmethod
    def about_law(cls, poisson: float, sd: float) -> Proposal:
        """See `warpbrain.physics.mechanism.Mechanism`; the coefficient is the exponent."""
        return Proposal.of_one(lambda a: cls(exponent=a), NEO_HOOKEAN, sd, "smooth", NEO_HOOKEAN, region="all tissue")

    @classmethod
    def size_in_words(cls, values: Values, gravity_axis: tuple[float, float, float] | None = None) -> Sequence[str]:
        if "exponent" not in values:
            return []
        exponent = values["exponent"]
        clause = f"Ogden's exponent is {measured(exponent.value, exponent.sd)}"
        if exponent.sd > abs(exponent.value - NEO_HOOKEAN):
            return [clause]
        more, less = ("compression", "tension") if exponent.value < NEO_HOOKEAN else ("tension", "compression")
        return [f"{clause}: it resists {more} more, and {less} less, than the neo-Hookean law"]

    @classmethod
    def check_tests(cls, tests: Tests) -> None:
        sheared = bool(tests.modes & {"shear", "torsion"})
        if tests.tension + tests.compression + sheared < 2:
            raise NotTestableError(f"needs {' and '.join(cls.needs)}")

    def substitute(self, label: int, law: Law, poisson: float, formulation: str) -> tuple[Law, float, str]:
        return Ogden.of_shear_modulus(law.shear_modulus, self.exponent), poisson, formulation
