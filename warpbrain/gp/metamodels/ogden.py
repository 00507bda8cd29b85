"""Ogden meta-model with one term: `Psi = mu/alpha (l^alpha + 2 l^(-alpha/2) - 3)` (supplement eq. (2)).

With `q = l^(alpha/2)` the bracket is `q^2 + 2/q - 3 = (q - 1)^2 (1 + 2/q)`, and `q - 1` from `expm1` has all its digits
near `l = 1`, where the three terms of the bracket cancel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from warpbrain.gp.literature.energies import Floats
from warpbrain.gp.metamodels.box import Box
from warpbrain.gp.metamodels.meta_model import MetaModel, Values

if TYPE_CHECKING:
    from warpbrain.physics.laws import Law

#: Largest `|alpha|` of the paper's searches; "high" has boxes to 5, 10, 20 and 50 there.
_LIMITS = {"low": 5.0, "high": 50.0}
#: Smallest `|alpha|` that is positive or negative: between them laws are unstable (-2 to 1, the paper allows 0.1).
_POSITIVE, _NEGATIVE = 0.1, 2.1


@dataclass(frozen=True)
class OgdenMetaModel(MetaModel):
    """Two parameters, `mu` [Pa] and `alpha`, of the same sign.

    Examples
    --------
    >>> OgdenMetaModel().shear_modulus([-400.0, -5.0])
    1000.0
    """

    name: ClassVar[str] = "ogden"
    parameter_names: ClassVar[tuple[str, ...]] = ("mu", "alpha")
    units: ClassVar[tuple[str, ...]] = ("Pa", "")

    def energy(self, stretches: Floats, values: Values) -> Floats:
        mu, alpha = values
        return mu / alpha * _bracket(alpha * np.log(stretches))

    def jacobian(self, stretches: Floats, values: Values) -> Floats:
        mu, alpha = values
        power = alpha * np.log(stretches)
        bracket = _bracket(power)
        # d(l^alpha + 2 l^(-alpha/2))/dalpha = ln l (l^alpha - l^(-alpha/2))
        by_alpha = mu / alpha**2 * (power * (np.expm1(power) - np.expm1(-0.5 * power)) - bracket)
        return np.stack([bracket / alpha, by_alpha], axis=1)

    def boxes(self, search: str = "high") -> tuple[Box, ...]:
        """Exponents of either sign, each searched from its smallest and from its largest.

        "low" goes to 5 and -5, as the paper's two boxes. "high" goes to 50 and -50: the paper has boxes to 5, 10, 20
        and 50 there, all with the start of the smallest exponent, and the last of them holds the others. A curve can
        have two optima in positive exponents (Schiavone 2009: 0.1 and 12.2), and then all searches of the paper may end
        in the worse one: in one of 300 curves, of which searches from both ends missed none.
        """
        limit = _LIMITS[search]
        return (
            *(Box((0.1, _POSITIVE), (math.inf, limit), (1000.0, alpha)) for alpha in (_POSITIVE, limit)),
            *(Box((-math.inf, -limit), (-0.1, -_NEGATIVE), (-1000.0, -alpha)) for alpha in (_NEGATIVE, limit)),
        )

    def law(self, values: Values) -> Law:
        from warpbrain.physics.laws import Ogden

        mu, alpha = values
        return Ogden((float(mu),), (float(alpha),))

    def shear_modulus(self, values: Values) -> float:
        mu, alpha = values
        return 0.5 * float(mu) * float(alpha)


def _bracket(power: Floats) -> Floats:
    """`e^x + 2 e^(-x/2) - 3`."""
    return np.expm1(0.5 * power) ** 2 * (1.0 + 2.0 * np.exp(-0.5 * power))
