"""Neo-Hookean law: `w = mu/2 (I1 - 3)` (supplement eq. (2)).

coupled    Psi = mu/2 (I1 - 3) - mu ln J + lam/2 (ln J)^2
uncoupled  Psi = mu/2 (J^(-2/3) I1 - 3) + K/2 (J - 1)^2
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
    mu = parameters[e, 1]
    log_J = wp.log(J)
    half = type(J)(0.5)
    return half * mu * (I1 - type(J)(3.0)) - mu * log_J + half * lam * log_J * log_J


@wp.func
def _coupled_derivatives(I1: Any, I2: Any, J: Any, parameters: wp.array2d[Any], e: int):
    lam = parameters[e, 0]
    mu = parameters[e, 1]
    zero = type(J)(0.0)
    pressure = lam * wp.log(J) - mu
    return (
        type(J)(0.5) * mu, zero, pressure / J,
        zero, zero, zero, zero, zero, (lam - pressure) / (J * J),
    )  # fmt: skip


@wp.func
def _uncoupled_energy(I1: Any, I2: Any, J: Any, parameters: wp.array2d[Any], e: int):
    K = parameters[e, 0]
    mu = parameters[e, 1]
    root = wp.cbrt(J)
    dilation = J - type(J)(1.0)
    return type(J)(0.5) * (mu * (I1 / (root * root) - type(J)(3.0)) + K * dilation * dilation)


@wp.func
def _uncoupled_derivatives(I1: Any, I2: Any, J: Any, parameters: wp.array2d[Any], e: int):
    K = parameters[e, 0]
    mu = parameters[e, 1]
    zero = type(J)(0.0)
    root = wp.cbrt(J)
    d1 = type(J)(0.5) * mu / (root * root)
    d1J = type(J)(-2.0) / type(J)(3.0) * d1 / J
    return (
        d1, zero, d1J * I1 + K * (J - type(J)(1.0)),
        zero, zero, d1J, zero, zero, type(J)(-5.0) / type(J)(3.0) * d1J * I1 / J + K,
    )  # fmt: skip


@dataclass(frozen=True)
class NeoHookean(Law):
    """Neo-Hookean law.

    Parameters
    ----------
    mu : float
        Shear modulus [Pa], positive.

    Raises
    ------
    InputError
        If `mu` is not a positive number.
    """

    mu: float
    name: ClassVar[str] = "neo-hookean"
    device: ClassVar[Mapping[str, InvariantLaw]] = {
        "coupled": InvariantLaw("neo_hookean_coupled", _coupled_energy, _coupled_derivatives, second_invariant=False),
        "uncoupled": InvariantLaw(
            "neo_hookean_uncoupled", _uncoupled_energy, _uncoupled_derivatives, second_invariant=False
        ),
    }
    keys: ClassVar[Mapping[str, LawKey]] = {"mu": LawKey("Shear modulus.")}
    coordinates: ClassVar[tuple[Coordinate, ...]] = (MODULUS,)

    def __post_init__(self) -> None:
        require_finite(self.name, "mu", self.mu)
        if self.mu <= 0.0:
            raise InputError(f"{self.name}: mu = {self.mu:g} Pa: the shear modulus must be positive")

    @property
    def shear_modulus(self) -> float:
        return self.mu

    @classmethod
    def of_shear_modulus(cls, mu: float) -> "NeoHookean":
        return cls(mu)

    def energy(self, stretches: Floats) -> Floats:
        return 0.5 * self.mu * (np.sum(stretches**2, axis=-1) - 3.0)

    def scaled_to(self, shear_modulus: float) -> "NeoHookean":
        return NeoHookean(shear_modulus)
