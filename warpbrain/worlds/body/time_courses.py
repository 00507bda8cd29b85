"""Time courses of a cause that sets in while recordings are made: its size over the recorded times.

Recordings tell only the interval in which it sets in: before the first time, or between two consecutive ones. From then
on it is there all at once, grows evenly, or approaches its full size exponentially,

    f(t) = 1,    (t - t0) / (T - t0),    1 - exp(-3 (t - t0) / (T - t0)),      f = 0 before,

`t0` the beginning of the interval and `T` the last time. A cause that is seen at the last time alone has no course.

A cause may also change from one recorded time to the next. Then its size is a Gaussian process over the recorded times,
with a squared exponential covariance of a variance of one. Its time is the rank of a recorded one: recordings are made
as densely as things change. So it needs few modes, and a course is found as the coefficients of these are.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference.beliefs import belief
from warpbrain.physics.proposal import Proposal, Varying, modes_between
from warpbrain.worlds.body.sensors import Sensors

AT_ONCE, EVENLY, SLOWER = "all at once", "growing evenly", "growing ever more slowly"
#: Size over the elapsed part of the time from onset to the last recording.
_SHAPES: dict[str, Callable[[Floats], Floats]] = {
    AT_ONCE: np.ones_like,
    EVENLY: lambda part: part,
    SLOWER: lambda part: -np.expm1(-3.0 * part),
}


@dataclass(frozen=True)
class TimeCourse:
    """An interval of onset and a shape."""

    interval: int  # number of the interval in which it begins
    #: The first time of that interval, and the last recorded one [s].
    begin: float
    end: float
    shape: str  # in words

    def factor(self, times: Floats) -> Floats:
        """Part (n,) of its full size at times (n,) [s]."""
        if not np.isfinite(self.end):
            return np.ones_like(times)
        part = np.maximum((times - self.begin) / (self.end - self.begin), 0.0)
        return np.where(part > 0.0, _SHAPES[self.shape](part), 0.0)


def time_courses(times: Sequence[float]) -> list[TimeCourse]:
    """All courses for recorded times [s]; with one time or none only that of a constant cause."""
    if len(times) < 2:
        return [TimeCourse(0, 0.0, np.inf, AT_ONCE)]
    times = finite_times(np.array(times)).tolist()
    courses = []
    for number, begin in enumerate((0.0, *times[:-1])):
        shapes = (AT_ONCE,) if number == len(times) - 1 else tuple(_SHAPES)
        courses += [TimeCourse(number, begin, times[-1], shape) for shape in shapes]
    return courses


def finite_times(times: Floats) -> Floats:
    """Times [s] with an end that is as far from the last of the others as that is from the load."""
    known = times[np.isfinite(times)]
    return np.where(np.isfinite(times), times, 2.0 * known.max() if len(known) else np.inf)


def factor_of_rows(course: TimeCourse, sensors: Sensors) -> Floats:
    """Part (n,) of the full size by which each row differs from the state that it is counted from."""
    return _since_reference(lambda seconds: course.factor(seconds)[:, None], sensors)[:, 0]


def modes_of_rows(times: Sequence[float], sensors: Sensors) -> Floats:
    """Modes (n, r) on rows of a cause that changes from one of several times [s] to the next."""
    ends, modes = modes_of(times)
    return _since_reference(lambda seconds: modes_between(ends, modes, seconds), sensors)


def _since_reference(factors_at: Callable[[Floats], Floats], sensors: Sensors) -> Floats:
    """Factors (n, r) at the times [s] of rows, less those at the times that they are counted from."""
    after, before = np.split(factors_at(finite_times(np.concatenate([sensors.times, sensors.references]))), 2)
    return np.where(sensors.before[:, None] < 0, after, after - before)


def main_courses(times: Sequence[float]) -> list[TimeCourse]:
    """A representative subset of the courses: all at once in each interval, or evenly from the beginning on."""
    courses = time_courses(times)
    return [c for c in courses if c.shape == AT_ONCE or (c.interval == 0 and c.shape == EVENLY)]


def modes_of(times: Sequence[float]) -> tuple[Floats, Floats]:
    """Finite times (m,) [s], and modes (m, r) of the process over them.

    The largest come first; their squares have the sum of the variances.
    """
    ranks = np.linspace(0.0, 1.0, len(times))
    covariance = np.exp(-0.5 * ((ranks[:, None] - ranks) / belief("courses.reach")) ** 2)
    variances, vectors = np.linalg.eigh(covariance)
    variances, vectors = np.maximum(variances[::-1], 0.0), vectors[:, ::-1]
    left = 1.0 - np.cumsum(variances) / variances.sum()
    kept = int(np.searchsorted(-left, -belief("courses.cut"))) + 1
    # the sign of an eigenvector is arbitrary
    signs = np.where(vectors[-1] < 0.0, -1.0, 1.0)
    return finite_times(np.array(times)), np.asarray((signs * vectors * np.sqrt(variances))[:, :kept])


def over_time(proposals: Sequence[Proposal], times: Sequence[float]) -> list[Proposal]:
    """Proposals, and with several times [s] those that may change from one to the next with a course, too."""
    constant = [proposal for proposal in proposals if not proposal.only_over_time]
    if len(times) < 2:
        return constant
    ends, modes = modes_of(times)
    return constant + [Varying(proposal, ends, modes).proposal() for proposal in proposals if proposal.varying]
