"""How something may have come while recordings were made: parts of its full size over the recorded times.

Between two recorded times nothing is known of when it began, so what is told apart is the interval: before the first
time, or between two that follow each other. What begins there comes all at once, grows evenly, or nears its full size
ever more slowly,

    f(t) = 1,    (t - t0) / (T - t0),    1 - exp(-3 (t - t0) / (T - t0)),      f = 0 before,

`t0` the beginning of the interval and `T` the last time. What begins before the last time alone has no course.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

AT_ONCE, EVENLY, SLOWER = "all at once", "growing evenly", "growing ever more slowly"
#: From the part of the time that has gone by since the beginning.
_SHAPES: dict[str, Callable[[Floats], Floats]] = {
    AT_ONCE: np.ones_like,
    EVENLY: lambda part: part,
    SLOWER: lambda part: -np.expm1(-3.0 * part),
}


@dataclass(frozen=True)
class TimeCourse:
    """One way.

    Attributes
    ----------
    interval : int
        Number of the interval in which it begins.
    begin, end : float
        The first time of that interval, and the last recorded one [s].
    shape : str
        In words.
    """

    interval: int
    begin: float
    end: float
    shape: str

    def factor(self, times: Floats) -> Floats:
        """Part (n,) of its full size at times (n,) [s]."""
        if not np.isfinite(self.end):
            return np.ones_like(times)
        part = np.maximum((times - self.begin) / (self.end - self.begin), 0.0)
        return np.where(part > 0.0, _SHAPES[self.shape](part), 0.0)


def time_courses(times: Sequence[float]) -> list[TimeCourse]:
    """All ways for recorded times [s]; what is always there alone where there is one time or none."""
    if len(times) < 2:
        return [TimeCourse(0, 0.0, np.inf, AT_ONCE)]
    found = []
    for number, begin in enumerate((0.0, *times[:-1])):
        shapes = (AT_ONCE,) if number == len(times) - 1 else tuple(_SHAPES)
        found += [TimeCourse(number, begin, times[-1], shape) for shape in shapes]
    return found


def main_courses(times: Sequence[float]) -> list[TimeCourse]:
    """Fewer ways that stand for all: all at once in each interval, or evenly from the beginning on."""
    return [one for one in time_courses(times) if one.shape == AT_ONCE or (one.interval == 0 and one.shape == EVENLY)]
