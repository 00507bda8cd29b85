"""Neo-Hookean law: `w = mu/2 (I1 - 3)` (supplement eq. (2)).

coupled    Psi = mu/2 (I1 - 3) - mu ln J + lam/2 (ln J)^2
uncoupled  Psi = mu/2 (J^(-2/3) I1 - 3) + K/2 (J - 1)^2
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import InputError
from warpbrain.physics.laws.device import InvariantLaw
from warpbrain.physics.laws.law import MODULUS, Coordinate, Law, LawKey, require_finite
from warpbrain.physics.laws.mooney_rivlin import device_code


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
    device: ClassVar[Mapping[str, InvariantLaw]] = device_code("neo_hookean", second_invariant=False)
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

    def parameters(self) -> tuple[float, ...]:
        """Of Mooney-Rivlin's device code: `C1 = mu/2` and no `C2`."""
        return 0.5 * self.mu, 0.0

    def energy(self, stretches: Floats) -> Floats:
        return 0.5 * self.mu * (np.sum(stretches**2, axis=-1) - 3.0)

    def scaled_to(self, shear_modulus: float) -> "NeoHookean":
        return NeoHookean(shear_modulus)
