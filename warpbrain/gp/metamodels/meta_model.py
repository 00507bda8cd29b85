"""What a meta-model is: the base class of the laws in this folder."""

from __future__ import annotations

import abc
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from warpbrain.gp.literature.energies import Floats
from warpbrain.gp.metamodels.box import Box

if TYPE_CHECKING:
    from warpbrain.physics.laws import Law

Values = Sequence[float] | Floats


@dataclass(frozen=True)
class MetaModel(abc.ABC):
    """A law of few parameters on the incompressible uniaxial path `(l, l^-1/2, l^-1/2)` (supplement eq. (2))."""

    #: Of its law, as in `warpbrain.physics.laws.LAWS`.
    name: ClassVar[str]
    parameter_names: ClassVar[tuple[str, ...]]
    #: Of the parameters: "Pa", or "" for a number without unit.
    units: ClassVar[tuple[str, ...]]

    @abc.abstractmethod
    def energy(self, stretches: Floats, values: Values) -> Floats:
        """Strain energy `Psi` [Pa] at stretches `l` > 0 of shape (n,), good to all digits near `l = 1`; (n,)."""

    @abc.abstractmethod
    def jacobian(self, stretches: Floats, values: Values) -> Floats:
        """Its derivatives by the parameters, (n, p): the numerators of supplement eq. (3)."""

    @abc.abstractmethod
    def boxes(self, search: str = "high") -> tuple[Box, ...]:
        """Boxes whose best optimum is the fit, for one of `SEARCHES`."""

    @abc.abstractmethod
    def law(self, values: Values) -> Law:
        """The law that a simulation takes.

        Raises
        ------
        InputError
            If the parameters are not those of a law, for one thing because the shear modulus is not positive.
        """

    @abc.abstractmethod
    def shear_modulus(self, values: Values) -> float:
        """Shear modulus at rest `mu0` [Pa]; `d2Psi/dl2 = 3 mu0` at `l = 1`."""
