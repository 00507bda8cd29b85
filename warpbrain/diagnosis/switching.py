"""States with a mechanism that is there or not: solved anew, and remembered."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.effects import Switched
from warpbrain.diagnosis.sensors import Sensors
from warpbrain.diagnosis.states import SolvedState, States
from warpbrain.physics.mechanism import Mechanism

Floats = NDArray[np.float64]


def switched(states: States, state: SolvedState, sensors: Sensors, known: dict[str, SolvedState]) -> Switched:
    """What answers switches at a state.

    Parameters
    ----------
    states : States
    state : SolvedState
        Without the mechanisms.
    sensors : Sensors
        Whose answers are asked for.
    known : dict
        States that were solved already; more are put there.
    """

    def answer(mechanism: Mechanism) -> Floats:
        key = repr(mechanism)
        if key not in known:
            asked = replace(state.hypothesis, mechanisms=(mechanism,))
            known[key] = states.solve(asked, state.u)
        return sensors.answer(known[key].u - state.u, known[key].reactions - state.reactions)

    answer.known = known  # type: ignore[attr-defined]
    return answer
