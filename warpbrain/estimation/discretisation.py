"""What the mesh gets wrong: the state on elements of half the size, less the state.

Linear tetrahedra are too stiff, near nu = 1/2 by several percent of the displacement on the meshes that one can afford.
Recordings know nothing of elements: fitted as it is, such a mesh finds tissue that is too soft by as much, and says so
with a standard deviation that is far smaller than that. So what is recorded is taken to be

    H(u_h + a d) + noise,    d = u_(h/2) - u_h,    a ~ N(5/3, 0.4^2)

If the error falls with the power p of the size, then `a = 2^p / (2^p - 1)` (Richardson's extrapolation): 4/3 for p = 2,
as on smooth solutions, and 2 for p = 1, as at the edges of what is held and where elements lock. The prior holds both;
`a` is estimated along with the tissue and integrated out of what is said of it. `d` is computed near the estimate and
kept, since it changes little as the parameters do.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.case import Case
from warpbrain.errors import InputError, SolveError
from warpbrain.estimation.forward import ROUGH, Forward, State
from warpbrain.estimation.parameters import Parameters
from warpbrain.physics.force import NodalForce
from warpbrain.simulation.finer import FinerCase, restricted
from warpbrain.simulation.of_case import model_of

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Discretisation:
    """What is believed of the amount `a` of the error of the mesh: normal.

    Attributes
    ----------
    mean, deviation : float
    """

    mean: float = 5.0 / 3.0
    deviation: float = 0.4

    def __post_init__(self) -> None:
        if not math.isfinite(self.mean):
            raise InputError(f"discretisation: mean = {self.mean}: expected a finite number")
        if not (math.isfinite(self.deviation) and self.deviation > 0.0):
            raise InputError(f"discretisation: deviation = {self.deviation}: expected a positive number")


@dataclass(frozen=True, eq=False)
class Difference:
    """The error of a mesh.

    Attributes
    ----------
    u, reactions : (n, 3) array
        Of the state on elements of half the size less the state, at the nodes of the mesh [m] and [N].
    theta : (p,) array
        Where it was computed.
    """

    u: Floats
    reactions: Floats
    theta: Floats

    @property
    def size(self) -> float:
        """Root mean square over the nodes [m]."""
        return float(np.sqrt(np.mean(np.sum(self.u**2, axis=1))))

    def less(self, other: Difference) -> Difference:
        """By how much it is more than another."""
        return Difference(self.u - other.u, self.reactions - other.reactions, self.theta)

    def plus(self, other: Difference) -> Difference:
        """Both together."""
        return Difference(self.u + other.u, self.reactions + other.reactions, self.theta)

    def times(self, factor: float) -> Difference:
        """So many times as large."""
        return Difference(factor * self.u, factor * self.reactions, self.theta)


class FinerMesh:
    """A case on elements of half the size.

    Parameters
    ----------
    case : Case
    theta : (p,) array
        Parameters to begin with.
    device : str, optional
    """

    def __init__(self, case: Case, theta: Floats, device: str | None = None) -> None:
        finer = FinerCase(case)
        self._prolong = finer.prolongation
        added = finer.spread(_shared_forces(Parameters.of(case).applied(case, theta)))
        self._forward = Forward(finer.case, theta, device, added)
        #: The last error on the finer mesh, with which the next state there is predicted.
        self._last: Floats | float = 0.0

    @property
    def solves(self) -> int:
        """Equilibria on this mesh."""
        return self._forward.solves

    def difference(self, state: State) -> Difference:
        """The error of a state.

        Raises
        ------
        SolveError
            If there is no equilibrium on the finer mesh.
        """
        start = self._prolong @ state.u
        try:
            finer = self._forward.solve(state.theta, start + self._last, ROUGH)
        except SolveError as error:
            raise SolveError(
                f"the error of the mesh is not known: on elements of half the size {error}; it can be left out, and "
                "then the estimate holds for this mesh only"
            ) from None
        self._last = finer.u - start
        u, reactions = restricted(self._prolong, finer.u, finer.reactions)
        return Difference(u - state.u, reactions - state.reactions, state.theta)


def _shared_forces(case: Case) -> Floats:
    """Nodal forces [N] of the boundaries that share a force among their nodes, long after every ramp."""
    model, _ = model_of(case)
    shared = [load for load in model.loads if isinstance(load, NodalForce)]
    total = np.zeros(model.mesh.points.shape)
    for load in shared:
        total += load.factor(math.inf) * load.nodal_forces(model.mesh)
    return total
