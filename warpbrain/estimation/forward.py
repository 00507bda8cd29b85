"""From parameters to a state, again and again: one system, solved from the state before, and its derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.case import Case
from warpbrain.estimation.parameters import Parameters
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.sensitivity import Sensitivities, SensitivitySolver
from warpbrain.simulation.system import System

Floats = NDArray[np.float64]


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
    """

    theta: Floats
    u: Floats
    reactions: Floats
    newton_iterations: int


class Forward:
    """A case as a function of the parameters of its tissues.

    Parameters
    ----------
    case : Case
        Laws of the parameters take the place of its own, which need not be known.
    theta : (p,) array
        Parameters to begin with; any that are stable.
    device : str, optional
    options : EquilibriumOptions, optional
        By default to 1e-9, so that differences of residuals mean something.

    Attributes
    ----------
    solves, newton_iterations : int
        Equilibria that were asked for, and what they took.
    """

    def __init__(
        self, case: Case, theta: Floats, device: str | None = None, options: EquilibriumOptions | None = None
    ) -> None:
        self.parameters = Parameters.of(case)
        self.system = System(model_of(self.parameters.applied(case, theta))[0], device)
        self.solves = self.newton_iterations = 0
        self._equilibrium = EquilibriumSolver(self.system, options or EquilibriumOptions(tolerance=1e-9))
        self._sensitivity = SensitivitySolver(self.system)

    def solve(self, theta: Floats, start: Floats | None = None) -> State:
        """The equilibrium of parameters, from a displacement (n, 3) [m] that is near to it, or from rest.

        Raises
        ------
        SolveError
            If none is found.
        """
        self.solves += 1
        self.system.set_materials(self.parameters.materials(theta))
        found = self._equilibrium.solve(start=start)
        self.newton_iterations += len(found.history)
        model = self.system.model
        reactions = np.where(model.constrained, found.internal - model.external_forces(), 0.0)
        return State(theta.copy(), found.u, reactions, len(found.history))

    def differentiate(self, state: State) -> Sensitivities:
        """Derivatives of a state by its parameters; `SolveError` if it is unstable."""
        return self._sensitivity.solve(state.u, self.parameters.materials, state.theta)
