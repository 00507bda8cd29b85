"""Mooney-Rivlin law: `w = C1 (I1 - 3) + C2 (I2 - 3)` (supplement eq. (2)), `mu0 = 2 (C1 + C2)`.

    coupled    Psi = C1 (I1 - 3) + C2 (I2 - 3) - (2 C1 + 4 C2) ln J + lam/2 (ln J)^2
    uncoupled  Psi = C1 (J^(-2/3) I1 - 3) + C2 (J^(-4/3) I2 - 3) + K/2 (J - 1)^2

`I2 = (I1^2 - C : C) / 2`; the supplement's eq. (1) writes `C : C`. At rest `d2I2` adds `4 C2` to the first Lame modulus
of the coupled form, so its `lam` is that much smaller than `2 mu0 nu / (1 - 2 nu)`: the Poisson ratio is the one given.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp

from warpbrain.arrays import Floats
from warpbrain.errors import InputError
from warpbrain.physics.laws.device import InvariantLaw
from warpbrain.physics.laws.law import MODULUS, Coordinate, Law, LawKey, require_finite


@wp.func
def _coupled_energy(I1: Any, I2: Any, J: Any, parameters: wp.array2d[Any], e: int):
    lam = parameters[e, 0]
    C1 = parameters[e, 1]
    C2 = parameters[e, 2]
    three = type(J)(3.0)
    log_J = wp.log(J)
    rest = type(J)(2.0) * C1 + type(J)(4.0) * C2
    return C1 * (I1 - three) + C2 * (I2 - three) - rest * log_J + type(J)(0.5) * lam * log_J * log_J


@wp.func
def _coupled_derivatives(I1: Any, I2: Any, J: Any, parameters: wp.array2d[Any], e: int):
    lam = parameters[e, 0]
    C1 = parameters[e, 1]
    C2 = parameters[e, 2]
    zero = type(J)(0.0)
    pressure = lam * wp.log(J) - type(J)(2.0) * C1 - type(J)(4.0) * C2
    return C1, C2, pressure / J, zero, zero, zero, zero, zero, (lam - pressure) / (J * J)


@wp.func
def _uncoupled_energy(I1: Any, I2: Any, J: Any, parameters: wp.array2d[Any], e: int):
    K = parameters[e, 0]
    C1 = parameters[e, 1]
    C2 = parameters[e, 2]
    three = type(J)(3.0)
    root = wp.cbrt(J)
    square = root * root
    dilation = J - type(J)(1.0)
    return C1 * (I1 / square - three) + C2 * (I2 / (square * square) - three) + type(J)(0.5) * K * dilation * dilation


@wp.func
def _uncoupled_derivatives(I1: Any, I2: Any, J: Any, parameters: wp.array2d[Any], e: int):
    K = parameters[e, 0]
    zero = type(J)(0.0)
    root = wp.cbrt(J)
    square = root * root
    d1 = parameters[e, 1] / square
    d2 = parameters[e, 2] / (square * square)
    d1J = type(J)(-2.0) / type(J)(3.0) * d1 / J
    d2J = type(J)(-4.0) / type(J)(3.0) * d2 / J
    dJ = d1J * I1 + d2J * I2 + K * (J - type(J)(1.0))
    dJJ = (type(J)(-5.0) / type(J)(3.0) * d1J * I1 + type(J)(-7.0) / type(J)(3.0) * d2J * I2) / J + K
    return d1, d2, dJ, zero, zero, d1J, zero, d2J, dJJ


def device_code(name: str, *, second_invariant: bool = True) -> dict[str, InvariantLaw]:
    """Device code of a law by its formulations, of the parameters `C1` and `C2`; without `second_invariant` of `C1`."""
    coupled, uncoupled = (_coupled_energy, _coupled_derivatives), (_uncoupled_energy, _uncoupled_derivatives)
    return {
        "coupled": InvariantLaw(f"{name}_coupled", *coupled, second_invariant),
        "uncoupled": InvariantLaw(f"{name}_uncoupled", *uncoupled, second_invariant),
    }


@dataclass(frozen=True)
class MooneyRivlin(Law):
    """Mooney-Rivlin law.

    Parameters
    ----------
    C1, C2 : float
        Coefficients of `I1 - 3` and `I2 - 3` [Pa], `C1 + C2 > 0`.

    Raises
    ------
    InputError
        If a coefficient is not a number or the shear modulus `2 (C1 + C2)` is not positive.
    """

    C1: float
    C2: float
    name: ClassVar[str] = "mooney-rivlin"
    device: ClassVar[Mapping[str, InvariantLaw]] = device_code("mooney_rivlin")
    keys: ClassVar[Mapping[str, LawKey]] = {
        "C1": LawKey("First Mooney-Rivlin modulus."),
        "C2": LawKey("Second Mooney-Rivlin modulus."),
    }
    coordinates: ClassVar[tuple[Coordinate, ...]] = (
        MODULUS,
        Coordinate("C2 / (C1 + C2)", "ratio C2 / (C1 + C2)", 0.5, "tissue.declared_share", 0.0, 1.0),
    )

    def __post_init__(self) -> None:
        require_finite(self.name, "C1, C2", self.C1, self.C2)
        if self.shear_modulus <= 0.0:
            raise InputError(
                f"{self.name}: C1 = {self.C1:g} Pa, C2 = {self.C2:g} Pa: the shear modulus 2 (C1 + C2) must be positive"
            )

    @property
    def shear_modulus(self) -> float:
        return 2.0 * (self.C1 + self.C2)

    @classmethod
    def of_shear_modulus(cls, mu: float, share: float = 0.5) -> "MooneyRivlin":
        """Equal coefficients, unless the share of `C2` in both is given."""
        return cls(0.5 * mu * (1.0 - share), 0.5 * mu * share)

    @property
    def shape(self) -> tuple[float, ...]:
        return (self.C2 / (self.C1 + self.C2),)

    def energy(self, stretches: Floats) -> Floats:
        squares = stretches**2
        I1 = np.sum(squares, axis=-1)
        I2 = squares[..., 0] * squares[..., 1] + squares[..., 1] * squares[..., 2] + squares[..., 2] * squares[..., 0]
        return self.C1 * (I1 - 3.0) + self.C2 * (I2 - 3.0)

    def volumetric_modulus(self, poisson: float, formulation: str) -> float:
        modulus = super().volumetric_modulus(poisson, formulation)
        return modulus - 4.0 * self.C2 if formulation == "coupled" else modulus

    def scaled_to(self, shear_modulus: float) -> "MooneyRivlin":
        factor = shear_modulus / self.shear_modulus
        return MooneyRivlin(factor * self.C1, factor * self.C2)
