"""From parameters to a state, again and again: one system, solved from the state before, and its derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.errors import SolveError
from warpbrain.estimation.parameters import Parameters
from warpbrain.simulation.assumed import with_mechanisms
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.model import Model
from warpbrain.simulation.of_case import plain_model_of
from warpbrain.simulation.sensitivity import Sensitivities, SensitivitySolver
from warpbrain.simulation.system import System

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
    elements : str
        See `Model`.

    Attributes
    ----------
    solves : int
        Equilibria that were asked for.
    """

    def __init__(
        self,
        case: Case,
        theta: Floats,
        device: str | None = None,
        elements: str = "tet4",
    ) -> None:
        self.parameters = Parameters.of(case)
        self.case = case
        plain, _ = plain_model_of(self.parameters.applied(case, theta))
        self._plain = replace(plain, elements=elements)
        self.system = System(self._model(theta), device)
        self._last: State | None = None
        self.solves = 0
        self._external = self.system.model.external_forces()
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
        self.system.set_model(self._model(theta))
        found = self._solvers[tolerance].solve(self._external, start)
        reactions = self.system.model.reactions(found.internal, self._external)
        self._last = State(theta.copy(), found.u, reactions, len(found.history), found.unstable_iterations > 0)
        return self._last

    def solve_from(self, theta: Floats, starts: Sequence[Floats | None], tolerance: float = EXACT) -> State:
        """The same from the first of some starts that leads to it; a bold one may turn elements inside out."""
        for start in starts[:-1]:
            try:
                return self.solve(theta, start, tolerance)
            except SolveError:
                pass
        return self.solve(theta, starts[-1], tolerance)

    def differentiate(self, state: State) -> Sensitivities:
        """Derivatives of a state by its parameters; `SolveError` if it is unstable."""
        if state is not self._last and any(term.memory for term in self.system.terms):
            # what contacts have found is that of the state that was solved for last
            state = self.solve(state.theta, state.u)
        return self._sensitivity.solve(state.u, self._model, state.theta)

    def _model(self, theta: Floats) -> Model:
        plain = replace(self._plain, materials=self.parameters.materials(theta))
        return with_mechanisms(plain, self.case.mechanisms)
