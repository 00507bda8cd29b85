"""What is estimated along with the tissue because it acts on the recordings, and is no property of the tissue.

The error of the mesh (`discretisation`), one number, and a rigid error of registration, six. Both are given normal
distributions beforehand and are integrated out of what is said of the tissue.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from warpbrain.estimation.discretisation import Difference, Discretisation
from warpbrain.estimation.forward import State
from warpbrain.estimation.observations import Residuals
from warpbrain.estimation.registration import NAMES, Registration

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Nuisances:
    """The nuisances of an estimation; a vector of q numbers holds those that there are, in this order.

    Attributes
    ----------
    discretisation, difference : Discretisation and Difference, or None
        The amount of the mesh's error, and that error; without them states are taken for exact.
    registration : Registration or None
        Without it positions are taken as they were recorded.
    """

    discretisation: Discretisation | None = None
    difference: Difference | None = None
    registration: Registration | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """With units."""
        first = ("amount of the mesh's error",) if self.difference is not None else ()
        return first + (NAMES if self.registration is not None else ())

    def __len__(self) -> int:
        return len(self.names)

    @cached_property
    def mean(self) -> Floats:
        """Before anything was observed, shape (q,)."""
        values = np.zeros(len(self))
        if self.difference is not None and self.discretisation is not None:
            values[0] = self.discretisation.mean
        return values

    @cached_property
    def precision(self) -> Floats:
        """Inverse covariance before anything was observed, shape (q, q)."""
        matrix = np.zeros((len(self), len(self)))
        if self.difference is not None and self.discretisation is not None:
            matrix[0, 0] = self.discretisation.deviation**-2
        if self.registration is not None:
            matrix[-6:, -6:] = self.registration.precision
        return matrix

    def negative_log(self, values: Floats) -> float:
        """Negative log density of the values (q,), less its constant."""
        away = values - self.mean
        return 0.5 * float(away @ self.precision @ away)

    def observed(self, state: State, values: Floats) -> tuple[Floats, Floats]:
        """Displacement and reactions (n, 3) without the error of the mesh."""
        if self.difference is None:
            return state.u, state.reactions
        return state.u + values[0] * self.difference.u, state.reactions + values[0] * self.difference.reactions

    def residuals(self, part: Residuals, values: Floats) -> Floats:
        """Residuals (n, d) of a recording, the rigid motion taken off."""
        return part.values if self.registration is None else part.values - part.rigid @ values[-6:]

    def jacobian(self, part: Residuals, du: Floats | None = None, dR: Floats | None = None) -> Floats:
        """Derivatives (n, d, p + q) of residuals by `theta`, along which displacement and reactions have derivatives
        (p, N, 3), and by the nuisances; by the nuisances alone if these are left out.
        """
        blocks = [] if du is None or dR is None else [part.derivative(du, dR)]
        if self.difference is not None:
            blocks.append(part.derivative(self.difference.u[None], self.difference.reactions[None]))
        if self.registration is not None:
            blocks.append(-part.rigid)
        return np.concatenate(blocks, axis=2)
