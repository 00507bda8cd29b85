"""What a material law is: the base class of the files in this folder.

Each law is written for the incompressible case by supplement eq. (2) of the paper and comes in two formulations:

- ``"coupled"`` (default): `Psi = w(l1, l2, l3) - c ln J + lam/2 (ln J)^2`, with `c` such that the rest state is free
  of stress and `lam = 2 mu0 nu / (1 - 2 nu)`;
- ``"uncoupled"``: `Psi = w(l1', l2', l3') + K/2 (J - 1)^2` with `l' = J^(-1/3) l` and
  `K = 2 mu0 (1 + nu) / (3 (1 - 2 nu))`.

At rest both have the shear modulus `mu0` and the Poisson ratio `nu` (Mooney-Rivlin corrects `lam` for that, see there).
"""

from __future__ import annotations

import abc
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import TYPE_CHECKING, ClassVar

from warpbrain.arrays import Floats
from warpbrain.errors import InputError

if TYPE_CHECKING:
    from warpbrain.physics.laws.device import InvariantLaw, PrincipalLaw

FORMULATIONS = ("coupled", "uncoupled")


@dataclass(frozen=True)
class Coordinate:
    """One of the numbers that a distribution of laws is written in."""

    name: str  # with the unit
    noun: str  # in a sentence
    reach: float  # how far a step of an estimation may go, so that the next equilibrium is within reach of the last
    belief: str  # of its standard deviation about what a case declares, the key
    low: float = -math.inf  # where it ends
    high: float = math.inf
    signed: bool = False  # whether positive and negative values are kinds of their own, with none between them


#: That of every law: a step goes a factor of e.
MODULUS = Coordinate("ln(mu0 / Pa)", "shear modulus", 1.0, "tissue.declared_modulus")


@dataclass(frozen=True)
class LawKey:
    """A parameter of a law as a tissue's table of `case.toml` has it: what it is, its unit, whether it is a list."""

    text: str
    unit: str = "Pa"
    several: bool = False


@dataclass(frozen=True)
class Law(abc.ABC):
    """A hyperelastic law with its parameters [Pa; exponents without unit]."""

    #: Name in `case.toml` and on the command line.
    name: ClassVar[str]
    #: Its keys in a tissue's table of `case.toml`, the fields of the class.
    keys: ClassVar[Mapping[str, LawKey]]
    #: Its coordinates: the modulus, and those of its shape; none if it has no prior.
    coordinates: ClassVar[tuple[Coordinate, ...]] = ()

    @property
    def shape(self) -> tuple[float, ...]:
        """Its coordinates but for the modulus."""
        return ()

    @property
    @abc.abstractmethod
    def shear_modulus(self) -> float:
        """Shear modulus at rest `mu0` [Pa]."""

    @classmethod
    @abc.abstractmethod
    def of_shear_modulus(cls, mu: float) -> Law:
        """The law of a shear modulus [Pa] in its usual shape: what `--model` puts in the place of another law.

        Where it has coordinates of its shape they are further arguments.
        """

    def parameters(self) -> tuple[float, ...]:
        """Parameters in the order of the device code, without the volumetric one: those of `keys` in turn."""
        values = (getattr(self, key) for key in self.keys)
        return tuple(number for value in values for number in (value if isinstance(value, tuple) else (value,)))

    @classmethod
    def parameter_rows(cls, laws: Sequence[Law]) -> list[tuple[float, ...]]:
        """Parameters of several laws of this class, as many for each: what one launch takes for several tissues."""
        return [law.parameters() for law in laws]

    @abc.abstractmethod
    def energy(self, stretches: Floats) -> Floats:
        """Incompressible strain energy `w` [Pa] at principal stretches of shape (..., 3)."""

    #: Device code by formulation.
    device: ClassVar[Mapping[str, InvariantLaw | PrincipalLaw]]

    @classmethod
    def device_law(cls, formulation: str) -> InvariantLaw | PrincipalLaw:
        """Device code of a formulation."""
        return cls.device[formulation]

    @abc.abstractmethod
    def scaled_to(self, shear_modulus: float) -> Law:
        """The same law with every modulus scaled so that its shear modulus at rest is `shear_modulus` [Pa]."""

    def volumetric_modulus(self, poisson: float, formulation: str) -> float:
        """`lam` (coupled) or `K` (uncoupled) [Pa] that gives the Poisson ratio at rest.

        Raises
        ------
        InputError
            If the Poisson ratio is outside (-1, 0.5) or the formulation is unknown.
        """
        if not (math.isfinite(poisson) and -1.0 < poisson < 0.5):
            raise InputError(f"poisson = {poisson:g}: the Poisson ratio must lie in the open interval (-1, 0.5)")
        if formulation not in FORMULATIONS:
            raise InputError(f"formulation = {formulation!r}: expected one of {', '.join(FORMULATIONS)}")
        if formulation == "coupled":
            return 2.0 * self.shear_modulus * poisson / (1.0 - 2.0 * poisson)
        return 2.0 * self.shear_modulus * (1.0 + poisson) / (3.0 * (1.0 - 2.0 * poisson))


def require_finite(law: str, key: str, *values: object) -> None:
    """Raise `InputError` if a parameter is NaN or infinite."""
    for value in values:
        if not isinstance(value, Real) or not math.isfinite(value):
            raise InputError(f"{law}: {key} = {value!r}: expected a finite number")
