"""Effects of switches, such as contact, that have no derivative: states with them are solved, and kept."""

from __future__ import annotations

from dataclasses import replace

from warpbrain.arrays import Floats
from warpbrain.physics.mechanism import Mechanism
from warpbrain.simulation.equilibrium import EquilibriumOptions
from warpbrain.worlds.body.sensors import Sensors
from warpbrain.worlds.body.states import SolvedState, States


class SolvedSwitches:
    """Effects of mechanisms on the sensors by solving the state with each.

    `state`: without the mechanisms. `sensors`: whose response is computed. `solved_states`: states that were solved
    already, by the mechanism; further ones are added. `instant`: number of the time of the states.
    """

    def __init__(
        self,
        states: States,
        state: SolvedState,
        sensors: Sensors,
        solved_states: dict[str, SolvedState],
        instant: int = -1,
    ) -> None:
        self._states, self._state, self._sensors = states, state, sensors
        self._solved_states, self._instant = solved_states, instant

    def at(self, instant: int, sensors: Sensors) -> SolvedSwitches:
        """The same of other sensors at the time of a number."""
        return SolvedSwitches(self._states, self._state, sensors, self._solved_states, instant)

    def effect_of(self, mechanism: Mechanism) -> Floats:
        """What sensors (n,) record in the state with a mechanism, less that without it."""
        key, state = repr(mechanism), self._state
        if key not in self._solved_states:
            hypothesis = replace(state.hypothesis, mechanisms=(mechanism,))
            # the loads act already: one load step, or the state is taken not to exist
            self._solved_states[key] = self._states.solve(hypothesis, state.u, iterations=EquilibriumOptions.max_newton)
        solved, without = self._solved_states[key].instants[self._instant], state.instants[self._instant]
        return self._sensors.answer(solved.u - without.u, solved.reactions - without.reactions)
