"""What is estimated along with the tissue because it acts on the recordings, and is no property of the tissue.

The error of the mesh (`discretisation`), 37 numbers, and a rigid error of registration, six. Both are given normal
distributions beforehand and are integrated out of what is said of the tissue.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.estimation.discretisation import NAMES as DISCRETISATION_NAMES
from warpbrain.estimation.discretisation import Discretisation, DiscretisationError
from warpbrain.estimation.forward import State
from warpbrain.estimation.gaussian import Gaussian
from warpbrain.estimation.observations import Residuals
from warpbrain.estimation.registration import NAMES as REGISTRATION_NAMES
from warpbrain.recordings.registration import Registration


@dataclass(frozen=True, eq=False)
class Nuisances:
    """The nuisances of an estimation; a vector of q numbers holds those that there are, in this order.

    Attributes
    ----------
    discretisation, error : Discretisation and DiscretisationError, or None
        The amount of the mesh's error, and that error; without them states are taken for exact.
    registration : Registration or None
        Without it positions are taken as they were recorded.
    """

    discretisation: Discretisation | None = None
    error: DiscretisationError | None = None
    registration: Registration | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """With units."""
        first = DISCRETISATION_NAMES if self.error is not None else ()
        return first + (REGISTRATION_NAMES if self.registration is not None else ())

    def __len__(self) -> int:
        return len(self.names)

    @cached_property
    def prior(self) -> Gaussian:
        """Before anything was observed."""
        means, deviations = [], []
        if self.error is not None and self.discretisation is not None:
            means.append(self.discretisation.means)
            deviations.append(self.discretisation.deviations)
        if self.registration is not None:
            means.append(np.zeros(6))
            deviations.append(self.registration.deviations)
        return Gaussian(np.concatenate([[], *means]), np.diag(np.concatenate([[], *deviations]) ** 2))

    def observed(self, state: State, values: Floats) -> tuple[Floats, Floats]:
        """Displacement and reactions (n, 3) without the error of the mesh."""
        if self.error is None:
            return state.u, state.reactions
        u, reactions = self.error.at(state.theta, values[: len(DISCRETISATION_NAMES)])
        return state.u + u, state.reactions + reactions

    def motion(self, values: Floats) -> Floats:
        """Rigid motion (6,) of what was recorded."""
        return np.zeros(6) if self.registration is None else values[-6:]

    def by_theta(self, values: Floats, du: Floats, dR: Floats) -> tuple[Floats, Floats]:
        """Derivatives (p, n, 3) of what is observed by `theta`, from those of a state."""
        if self.error is None:
            return du, dR
        more_du, more_dR = self.error.by_theta(values[: len(DISCRETISATION_NAMES)])
        return du + more_du, dR + more_dR

    def jacobian(
        self, part: Residuals, theta: Floats, values: Floats, derivatives: tuple[Floats, Floats] | None = None
    ) -> Floats:
        """Derivatives of residuals.

        Parameters
        ----------
        part : Residuals
        theta : (p,) array
        values : (q,) array
        derivatives : pair of (p, n, 3) arrays, optional
            Of the displacement and the reactions of the state by `theta`.

        Returns
        -------
        (n, d, p + q) array
            By `theta` and by the nuisances; by the nuisances alone (n, d, q) without derivatives of the state.
        """
        blocks = [] if derivatives is None else [part.derivative(*self.by_theta(values, *derivatives))]
        if self.error is not None:
            blocks.append(part.derivative(*self.error.by_values(theta, values[: len(DISCRETISATION_NAMES)])))
        if self.registration is not None:
            blocks.append(-part.rigid)
        return np.concatenate(blocks, axis=2)
