"""From parameters to states, again and again: a system for each, solved from the state before, and their derivatives.

A case has one state, or one for each time at which something else acts (`warpbrain.cases.moments`). Fields of several
states stand one after the other.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.cases.moments import Moments
from warpbrain.errors import SolveError
from warpbrain.estimation.parameters import Parameters
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.model import Model
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.sensitivity import SensitivitySolver
from warpbrain.simulation.system import System

#: Out-of-balance force of an equilibrium, relative: where differences of residuals must mean something, and where what
#: is left of it need only be far below any noise.
EXACT, ROUGH = 1e-7, 1e-5
#: Of the linear solves for derivatives: what is left of the error is far below a standard deviation of any parameter.
_DERIVATIVES = 1e-4


@dataclass(frozen=True, eq=False)
class State:
    """Equilibria of a case, in s states."""

    theta: Floats
    u: Floats  # (s n, 3) [m]
    reactions: Floats  # (s n, 3), what holds the constrained components [N]
    newton_iterations: int  # that it took
    #: The way to it led past states with an indefinite tangent: a slowly growing load may reach another one.
    passed_unstable: bool = False


class Forward:
    """A case as a function of the parameters of its tissues: laws of these take the place of its own.

    It begins with parameters `theta` (p,), any that are stable. `moments` are its states, the end alone unless given.
    """

    def __init__(
        self,
        case: Case,
        theta: Floats,
        device: str | None = None,
        elements: str = "tet4",
        moments: Moments | None = None,
    ) -> None:
        self.parameters = Parameters.of(case)
        self.case = case
        self.moments = Moments.of(case, ()) if moments is None else moments
        self.states = tuple(OneState(each, self.parameters, theta, device, elements) for each in self.moments.cases)
        #: Equilibria that were asked for.
        self.solves = 0

    def solve(self, theta: Floats, start: Floats | None = None, tolerance: float = EXACT) -> State:
        """The equilibria of parameters (p,), from displacements (s n, 3) [m] near to them, or from rest.

        `tolerance` is `EXACT` or `ROUGH`; `SolveError` if one is not found.
        """
        starts = [None] * len(self.states) if start is None else np.split(start, len(self.states))
        solved: list[State] = []
        for state, near in zip(self.states, starts, strict=True):
            self.solves += 1
            solved.append(state.solve(theta, solved[-1].u if near is None and solved else near, tolerance))
        return State(
            theta.copy(),
            np.concatenate([each.u for each in solved]),
            np.concatenate([each.reactions for each in solved]),
            sum(each.newton_iterations for each in solved),
            any(each.passed_unstable for each in solved),
        )

    def solve_from(self, theta: Floats, starts: Sequence[Floats | None], tolerance: float = EXACT) -> State:
        """The same from the first of some starts that leads to it; a bold one may turn elements inside out."""
        for start in starts[:-1]:
            try:
                return self.solve(theta, start, tolerance)
            except SolveError:
                pass
        return self.solve(theta, starts[-1], tolerance)

    def differentiate(self, state: State) -> tuple[Floats, Floats]:
        """Derivatives (p, s n, 3) of displacement and reactions by the parameters; `SolveError` if one is unstable."""
        displacements = np.split(state.u, len(self.states))
        each = [model.differentiate(state.theta, u) for model, u in zip(self.states, displacements, strict=True)]
        du, dR = (np.concatenate(parts, axis=1) for parts in zip(*each, strict=True))
        return du, dR


class OneState:
    """One state of a case as a function of the parameters of its tissues; parameters as of `Forward`."""

    def __init__(self, case: Case, parameters: Parameters, theta: Floats, device: str | None, elements: str) -> None:
        self.case, self._parameters = case, parameters
        self.system = System(replace(model_of(parameters.applied(case, theta)), elements=elements), device)
        self._last: Floats | None = None
        self._external = self.system.model.external_forces()
        self._solvers = {
            tolerance: EquilibriumSolver(self.system, EquilibriumOptions(tolerance=tolerance))
            for tolerance in (EXACT, ROUGH)
        }
        self._sensitivity = SensitivitySolver(self.system, _DERIVATIVES)

    def solve(self, theta: Floats, start: Floats | None, tolerance: float = EXACT) -> State:
        """The equilibrium; `SolveError` if none is found."""
        self.system.set_model(self._model(theta))
        equilibrium = self._solvers[tolerance].solve(self._external, start)
        reactions = self.system.model.reactions(equilibrium.internal, self._external)
        self._last = equilibrium.u
        return State(theta, equilibrium.u, reactions, len(equilibrium.history), equilibrium.unstable_iterations > 0)

    def differentiate(self, theta: Floats, u: Floats) -> tuple[Floats, Floats]:
        """Derivatives of a state by its parameters; `SolveError` if it is unstable."""
        remembers = any(term.memory for term in self.system.terms)
        if remembers and (self._last is None or not np.array_equal(u, self._last)):
            # what contacts have found is that of the state that was solved for last
            u = self.solve(theta, u).u
        sensitivities = self._sensitivity.solve(u, self._model, theta)
        return sensitivities.u, sensitivities.reactions

    def _model(self, theta: Floats) -> Model:
        return self.system.model.with_materials(self._parameters.materials(theta))
