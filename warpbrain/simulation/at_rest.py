"""States of a body at rest at each time of its recordings, under what acts then."""

from __future__ import annotations

import math
from dataclasses import replace

from warpbrain.cases.case import Case
from warpbrain.cases.moments import Moments
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.result import NodalState, nodal_state_of
from warpbrain.simulation.system import System


def states_at_rest(case: Case, system: System, end: NodalState, tolerance: float) -> dict[float, NodalState]:
    """The state of each time at which something was recorded, or from which it is counted.

    Parameters
    ----------
    case : Case
    system : System
        Of the case.
    end : NodalState
        Its state long after everything.
    tolerance : float
        Of the other equilibria; see `EquilibriumOptions`.

    Raises
    ------
    SolveError
        If there is no equilibrium at one of the times.
    """
    moments = Moments.recorded(case)
    states, near = {math.inf: end}, end.u
    reached: dict[int, NodalState] = {}
    if len(moments.cases) == 1 and moments.cases[0] is case:
        reached[0] = end
    for time, number in zip(moments.times, moments.numbers, strict=True):
        if number not in reached:
            model = replace(model_of(moments.cases[number]), elements=system.model.elements)
            other = System(model, str(system.device), system.precision.name)
            found = EquilibriumSolver(other, EquilibriumOptions(tolerance=tolerance)).solve(start=near)
            other.u.assign(found.u)
            reached[number] = nodal_state_of(other)
            near = found.u
        states[time] = reached[number]
    return states
