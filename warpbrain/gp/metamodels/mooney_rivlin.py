"""Mooney-Rivlin meta-model: `Psi = C1 (l^2 + 2/l - 3) + C2 (2 l + l^-2 - 3)` (supplement eq. (2))."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from warpbrain.gp.literature import energies
from warpbrain.gp.literature.energies import Floats
from warpbrain.gp.metamodels.box import Box
from warpbrain.gp.metamodels.meta_model import MetaModel, Values

if TYPE_CHECKING:
    from warpbrain.physics.laws import Law


@dataclass(frozen=True)
class MooneyRivlinMetaModel(MetaModel):
    """Two parameters, `C1` and `C2` [Pa], both positive.

    Examples
    --------
    >>> MooneyRivlinMetaModel().shear_modulus([200.0, 100.0])
    600.0
    """

    name: ClassVar[str] = "mooney-rivlin"
    parameter_names: ClassVar[tuple[str, ...]] = ("C1", "C2")
    units: ClassVar[tuple[str, ...]] = ("Pa", "Pa")

    def energy(self, stretches: Floats, values: Values) -> Floats:
        C1, C2 = values
        return energies.mooney_rivlin(stretches, C1=C1, C2=C2)

    def jacobian(self, stretches: Floats, values: Values) -> Floats:
        return np.stack([energies.first(stretches), energies.second(stretches)], axis=1)

    def boxes(self, search: str = "high") -> tuple[Box, ...]:
        """The paper's, the same for both searches."""
        return (Box((0.1, 0.1), (math.inf, math.inf), (1000.0, 1000.0)),)

    def law(self, values: Values) -> Law:
        from warpbrain.physics.laws import MooneyRivlin

        C1, C2 = values
        return MooneyRivlin(float(C1), float(C2))

    def shear_modulus(self, values: Values) -> float:
        C1, C2 = values
        return 2.0 * (float(C1) + float(C2))
