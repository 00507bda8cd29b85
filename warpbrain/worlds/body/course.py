"""What goes on in time under a mechanism, at every pace: one series of solved states serves all paces.

Where nothing but one rate sets the pace, as a permeability does where fluid flows, the state at a time `t` of a course
that goes `p` times as fast is that of the course at `p t`. So the answers of the sensors are interpolated over the
logarithm of time: values and slopes are exact but for that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.worlds.body.sensors import Sensors

Floats = NDArray[np.float64]

#: Factor from a time of a course to the next.
_FACTOR = 1.9


def course_times(recorded: Floats, paces: Sequence[float]) -> Floats:
    """Times (k,) [s] at which a course is solved, so that recorded times (n,) [s] at all paces lie among them."""
    first, last = recorded.min() * min(paces), recorded.max() * max(paces)
    return np.geomspace(first, last, 2 + int(np.log(last / first) / np.log(_FACTOR)))


@dataclass(frozen=True, eq=False)
class Course:
    """Answers of the sensors along a course.

    Attributes
    ----------
    sensors : Sensors
    times : (k,) array
        [s]
    answers : (n, k) array
        What is computed at each time less what is computed at the state without the mechanism.
    """

    sensors: Sensors
    times: Floats
    answers: Floats

    @cached_property
    def _over_time(self) -> Any:
        from scipy.interpolate import PchipInterpolator

        return PchipInterpolator(np.log(self.times), self.answers, axis=1)

    def at(self, pace: float) -> Floats:
        """Answers (n,) at the recorded times if all goes so many times faster; nothing is left in the end.

        Before the first time it is as at the first, after the last as at the last.
        """
        found = np.zeros(len(self.sensors))
        for time in np.unique(self.sensors.times[np.isfinite(self.sensors.times)]):
            rows = self.sensors.times == time
            at = float(np.clip(pace * time, self.times[0], self.times[-1]))
            found[rows] = self._over_time(np.log(at))[rows]
        return found
