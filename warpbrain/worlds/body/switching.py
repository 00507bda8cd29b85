"""States with a mechanism that no derivative stands for: solved anew, and remembered."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from warpbrain.physics.mechanism import Mechanism
from warpbrain.worlds.body.sensors import Sensors
from warpbrain.worlds.body.states import SolvedState, States

Floats = NDArray[np.float64]

#: Iterations after which a state beside the base is taken not to exist: those that do take 3 to 18.
_ITERATIONS = 30


class Solving:
    """Answers of the sensors to what is solved anew beside a state.

    Parameters
    ----------
    states : States
    state : SolvedState
        Without the mechanisms.
    sensors : Sensors
        Whose answers are asked for.
    known : dict of str to SolvedState
        States that were solved already, by what acts there; more are put there.
    """

    def __init__(self, states: States, state: SolvedState, sensors: Sensors, known: dict[str, SolvedState]) -> None:
        self._states, self._state, self._sensors = states, state, sensors
        self.known = known

    def there(self, mechanism: Mechanism) -> Floats:
        """Of the state with the mechanism, less those without it: (n,)."""
        key, state = repr(mechanism), self._state
        if key not in self.known:
            asked = replace(state.hypothesis, mechanisms=(mechanism,))
            self.known[key] = self._states.solve(asked, state.u, iterations=_ITERATIONS)
        solved = self.known[key]
        return self._sensors.answer(solved.u - state.u, solved.reactions - state.reactions)
