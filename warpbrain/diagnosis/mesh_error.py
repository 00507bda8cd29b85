"""The error of the mesh under a hypothesis: the state on elements of half the size, less the state.

Linear tetrahedra answer too little, and to each mechanism in its own measure: a pressure in a cavity moves a coarse
mesh far less than weight does. So the error is computed with the mechanism that is fitted, not once for all: otherwise
its size would come out wrong by as much. And it grows as tissue is less compressible than was assumed, by more than the
displacement itself: that belongs to what compressibility may explain.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.states import TOLERANCE, Hypothesis, SolvedState, States
from warpbrain.errors import SolveError
from warpbrain.estimation.discretisation import Difference
from warpbrain.physics.mechanism import Mechanism
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.finer import FinerCase, restricted
from warpbrain.simulation.system import System

Floats = NDArray[np.float64]

#: Out-of-balance force of the finer state, relative: far below the error that is looked for.
_ROUGH = 10.0 * TOLERANCE


@dataclass(frozen=True, eq=False)
class MeshErrors:
    """The error of the mesh at a state, and how it changes.

    Attributes
    ----------
    own : Difference
    by_volume : Difference
        What one standard deviation of compressibility adds to it.
    finer : FinerStates
        Which finds it at other states.
    """

    own: Difference
    by_volume: Difference
    finer: FinerStates


class FinerStates:
    """Solves hypotheses on elements of half the size, each from what the last was beyond its mesh.

    Parameters
    ----------
    states : States
    """

    def __init__(self, states: States) -> None:
        self.states = states
        self._beyond: Floats | float = 0.0

    def errors(self, state: SolvedState, less_compressible: Mechanism) -> MeshErrors:
        """The error of a state, and what it is beside that with one standard deviation of compressibility.

        Parameters
        ----------
        state : SolvedState
        less_compressible : Mechanism
            Tissue that is less compressible by that.

        Raises
        ------
        SolveError
            If there is no equilibrium on the finer mesh.
        """
        own = self.error(state.hypothesis, state)
        mechanisms = (*state.hypothesis.mechanisms, less_compressible)
        other = self.error(replace(state.hypothesis, mechanisms=mechanisms), state)
        return MeshErrors(own, Difference(other.u - own.u, other.reactions - own.reactions, own.theta), self)

    def error(self, hypothesis: Hypothesis, near: SolvedState) -> Difference:
        """The error of a hypothesis without its stiffness field, which it hardly depends on.

        Parameters
        ----------
        hypothesis : Hypothesis
        near : SolvedState
            A state near to it.

        Raises
        ------
        SolveError
            If there is no equilibrium on the finer mesh.
        """
        even = replace(hypothesis, field=np.zeros_like(hypothesis.field))
        coarse = self.states.solve(even, near.u)
        finer = FinerCase(self.states.case_of(even))
        model = finer.model(coarse.system.model)
        external = model.external_forces()
        solver = EquilibriumSolver(System(model, self.states.device), EquilibriumOptions(tolerance=_ROUGH))
        flat = finer.prolongation @ coarse.u
        try:
            found = solver.solve(external, flat + self._beyond)
        except SolveError:
            found = solver.solve(external, flat)
        self._beyond = found.u - flat
        u, reactions = restricted(finer.prolongation, found.u, model.reactions(found.internal, external))
        return Difference(u - coarse.u, reactions - coarse.reactions, hypothesis.theta)
