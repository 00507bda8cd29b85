"""Neo-Hookean meta-model: `Psi = mu/2 (l^2 + 2/l - 3)` (supplement eq. (2))."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from warpbrain.gp.literature import energies
from warpbrain.gp.literature.energies import Floats
from warpbrain.gp.metamodels.box import Box
from warpbrain.gp.metamodels.meta_model import MetaModel, Values

if TYPE_CHECKING:
    from warpbrain.physics.laws import Law


@dataclass(frozen=True)
class NeoHookeanMetaModel(MetaModel):
    """One parameter, the shear modulus `mu` [Pa].

    Examples
    --------
    >>> NeoHookeanMetaModel().law([600.0])
    NeoHookean(mu=600.0)
    """

    name: ClassVar[str] = "neo-hookean"
    parameter_names: ClassVar[tuple[str, ...]] = ("mu",)
    units: ClassVar[tuple[str, ...]] = ("Pa",)

    def energy(self, stretches: Floats, values: Values) -> Floats:
        (mu,) = values
        return energies.neo_hookean(stretches, mu=mu)

    def jacobian(self, stretches: Floats, values: Values) -> Floats:
        return 0.5 * energies.first(stretches)[:, None]

    def boxes(self, search: str = "high") -> tuple[Box, ...]:
        """The paper's, the same for both searches."""
        return (Box((1e-3,), (math.inf,), (1000.0,)),)

    def law(self, values: Values) -> Law:
        from warpbrain.physics.laws import NeoHookean

        (mu,) = values
        return NeoHookean(float(mu))

    def shear_modulus(self, values: Values) -> float:
        (mu,) = values
        return float(mu)
