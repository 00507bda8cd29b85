"""States with a mechanism that no derivative stands for: solved anew, and remembered."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from warpbrain.physics.mechanism import Mechanism
from warpbrain.worlds.body.course import Course, course_times
from warpbrain.worlds.body.sensors import Sensors
from warpbrain.worlds.body.states import SolvedState, States

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Known:
    """States that were solved already, by what acts there.

    Attributes
    ----------
    states : dict of str to SolvedState
        With what is there or not.
    courses : dict of str to (times, states)
        Displacement and reactions at each time.
    """

    states: dict[str, SolvedState] = field(default_factory=dict)
    courses: dict[str, tuple[Floats, list[tuple[Floats, Floats]]]] = field(default_factory=dict)


class Solving:
    """Answers of the sensors to what is solved anew beside a state.

    Parameters
    ----------
    states : States
    state : SolvedState
        Without the mechanisms.
    sensors : Sensors
        Whose answers are asked for.
    known : Known
        More are put there.
    """

    def __init__(self, states: States, state: SolvedState, sensors: Sensors, known: Known) -> None:
        self._states, self._state, self._sensors = states, state, sensors
        self.known = known

    def there(self, mechanism: Mechanism) -> Floats:
        """Of the state with the mechanism, less those without it: (n,)."""
        key, state = repr(mechanism), self._state
        if key not in self.known.states:
            asked = replace(state.hypothesis, mechanisms=(mechanism,))
            self.known.states[key] = self._states.solve(asked, state.u)
        found = self.known.states[key]
        return self._sensors.answer(found.u - state.u, found.reactions - state.reactions)

    def course(self, mechanism: Mechanism, paces: Sequence[float]) -> Course:
        """Of what goes on in time with the mechanism, at any of some paces."""
        key, state = repr(mechanism), self._state
        if key not in self.known.courses:
            times = course_times(np.array(self._states.times), paces)
            asked = replace(state.hypothesis, mechanisms=(mechanism,))
            self.known.courses[key] = times, self._states.course(asked, times.tolist(), state.u)
        times, moments = self.known.courses[key]
        answers = [self._sensors.answer(u - state.u, reactions - state.reactions) for u, reactions in moments]
        return Course(self._sensors, times, np.column_stack(answers))
