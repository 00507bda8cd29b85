"""An Ogden law of tissue that has grown: `F = F_e (1 + g)^(1/3)`, and the elastic part `F_e` alone is strained.

    Psi(l) = (1 + g) Psi_Ogden(l / (1 + g)^(1/3))

The stress-free state of an element is the grown one; where neighbours grow differently, stress is what fits them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import warp as wp

from warpbrain.physics.laws.device import PrincipalLaw
from warpbrain.physics.laws.law import Law
from warpbrain.physics.laws.ogden import Ogden

_ogden = Ogden.device_law("uncoupled")
_ogden_energy = _ogden.energy
_ogden_derivatives = _ogden.derivatives


@wp.func
def _energy(l: Any, parameters: wp.array2d[Any], e: int):
    # the last parameter is the growth; the law beneath counts its terms by whole pairs and does not see it
    volume = l.dtype(1.0) + parameters[e, parameters.shape[1] - 1]
    length = wp.pow(volume, l.dtype(1.0) / l.dtype(3.0))
    return volume * _ogden_energy(l / length, parameters, e)


@wp.func
def _derivatives(l: Any, parameters: wp.array2d[Any], e: int):
    volume = l.dtype(1.0) + parameters[e, parameters.shape[1] - 1]
    length = wp.pow(volume, l.dtype(1.0) / l.dtype(3.0))
    T, H, m = _ogden_derivatives(l / length, parameters, e)
    first = volume / length
    second = first / length
    return first * T, second * H, second * m


_DEVICE = PrincipalLaw("concealed_grown_ogden", _energy, _derivatives)


@dataclass(frozen=True)
class GrownOgden(Ogden):
    """Uncoupled Ogden law after growth.

    Parameters
    ----------
    mu, alpha : tuple of float
        As of `Ogden`; all laws of one body have the same number of terms.
    growth : float
        Relative growth of volume, above -1.
    """

    growth: float = 0.0
    name: ClassVar[str] = "grown ogden"

    def parameters(self) -> tuple[float, ...]:
        return (*super().parameters(), self.growth)

    @classmethod
    def parameter_rows(cls, laws: Sequence[Law]) -> list[tuple[float, ...]]:
        return [law.parameters() for law in laws]

    @classmethod
    def device_law(cls, formulation: str) -> PrincipalLaw:
        if formulation != "uncoupled":
            raise ValueError("growth is written for the uncoupled formulation")
        return _DEVICE
