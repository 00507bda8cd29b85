"""From parameters to a state, again and again: one system, solved from the state before, and its derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.case import Case
from warpbrain.errors import InputError
from warpbrain.estimation.parameters import Parameters
from warpbrain.physics.mechanism import Substituting
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.sensitivity import Sensitivities, SensitivitySolver
from warpbrain.simulation.system import System

Floats = NDArray[np.float64]

#: Out-of-balance force of an equilibrium, relative: where differences of residuals must mean something, and where what
#: is left of it need only be far below any noise.
EXACT, ROUGH = 1e-7, 1e-5
#: Of the linear solves for derivatives: what is left of the error is far below a standard deviation of any parameter.
_DERIVATIVES = 1e-4


@dataclass(frozen=True, eq=False)
class State:
    """An equilibrium of a case.

    Attributes
    ----------
    theta : (p,) array
    u, reactions : (n, 3) array
        Displacement [m], and what holds the constrained components [N].
    newton_iterations : int
        That it took.
    passed_unstable : bool
        The way to it led past states with an indefinite tangent: a slowly growing load may reach another one.
    """

    theta: Floats
    u: Floats
    reactions: Floats
    newton_iterations: int
    passed_unstable: bool = False


class Forward:
    """A case as a function of the parameters of its tissues.

    Parameters
    ----------
    case : Case
        Laws of the parameters take the place of its own, which need not be known.
    theta : (p,) array
        Parameters to begin with; any that are stable.
    device : str, optional
    added : (n, 3) array, optional
        Nodal forces [N] beside the loads of the case.

    Attributes
    ----------
    solves : int
        Equilibria that were asked for.
    """

    def __init__(self, case: Case, theta: Floats, device: str | None = None, added: Floats | None = None) -> None:
        for mechanism in case.mechanisms:
            if isinstance(mechanism, Substituting):
                raise InputError(
                    f"{case.path}: [[mechanism]] kind = '{mechanism.kind}': says what law tissues have, and so does an "
                    "estimate: leave it out, or write its law into the tissues"
                )
        self.parameters = Parameters.of(case)
        self.system = System(model_of(self.parameters.applied(case, theta))[0], device)
        self.solves = 0
        self._external = self.system.model.external_forces()
        if added is not None:
            self._external = self._external + added
        self._solvers = {
            tolerance: EquilibriumSolver(self.system, EquilibriumOptions(tolerance=tolerance))
            for tolerance in (EXACT, ROUGH)
        }
        self._sensitivity = SensitivitySolver(self.system, _DERIVATIVES)

    def solve(self, theta: Floats, start: Floats | None = None, tolerance: float = EXACT) -> State:
        """The equilibrium of parameters.

        Parameters
        ----------
        theta : (p,) array
        start : (n, 3) array, optional
            A displacement [m] that is near to it; rest by default.
        tolerance : {EXACT, ROUGH}

        Raises
        ------
        SolveError
            If none is found.
        """
        self.solves += 1
        self.system.set_materials(self.parameters.materials(theta))
        found = self._solvers[tolerance].solve(self._external, start)
        reactions = np.where(self.system.model.constrained, found.internal - self._external, 0.0)
        return State(theta.copy(), found.u, reactions, len(found.history), found.unstable_iterations > 0)

    def differentiate(self, state: State) -> Sensitivities:
        """Derivatives of a state by its parameters; `SolveError` if it is unstable."""
        return self._sensitivity.solve(state.u, self.parameters.materials, state.theta)
