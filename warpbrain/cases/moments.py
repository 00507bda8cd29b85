"""A case at the times of its recordings: what acts at each is all there, and nothing moves on.

A load with a ramp has the size at each time that its ramp says. At rest under loads that are held at that size a body
without memory is where it is then; so every time of a case is a case of its own, in which nothing depends on time.
"""

from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from warpbrain.cases.boundary import Boundary, Displaced
from warpbrain.cases.case import Case
from warpbrain.physics.load import Load, Ramped
from warpbrain.recordings.times import compared_rows, times_of


def case_at(case: Case, time: float) -> Case:
    """The case with everything held as it is at a time [s]; infinity is long after everything."""
    boundaries = tuple(_boundary_at(boundary, time) for boundary in case.boundaries)
    mechanisms = tuple(
        replace(m, ramp=_held(m.ramp, time)) if m.ramp else m
        for m in case.mechanisms
        # another load of its kind has its turn
        if not (isinstance(m, Load) and not m.several and m.factor(time) == 0.0)
    )
    return replace(case, boundaries=boundaries, mechanisms=mechanisms)


def _boundary_at(boundary: Boundary, time: float) -> Boundary:
    if isinstance(boundary, Displaced):
        if not boundary.has_history:
            return boundary
        x, y, z = (float(np.interp(time, boundary.times, component)) for component in np.array(boundary.values).T)
        return replace(boundary, times=(0.0,), values=((x, y, z),), file="")
    ramp = getattr(boundary, "ramp", ())
    return replace(boundary, ramp=_held(ramp, time)) if ramp else boundary  # type: ignore[call-arg]


def _held(ramp: Any, time: float) -> tuple[tuple[float, float]]:
    return ((0.0, Ramped(ramp=ramp).factor(time)),)


def _key(case: Case, time: float) -> tuple[Any, ...]:
    """What is equal at times at which the same acts."""
    factors = [m.factor(time) for m in case.mechanisms]
    held = (_boundary_at(boundary, time) for boundary in case.boundaries)
    return (*factors, *(getattr(b, "values", None) or getattr(b, "ramp", None) for b in held))


@dataclass(frozen=True, eq=False)
class Moments:
    """Times, and the cases at them."""

    times: tuple[float, ...]  # [s], increasing; infinity is the end
    cases: tuple[Case, ...]  # what differs; the case itself if nothing does from its end
    numbers: tuple[int, ...]  # for each time the number of its case

    @classmethod
    def of(cls, case: Case, times: Iterable[float]) -> "Moments":
        """The cases at some times [s]; with none at the end alone."""
        series = tuple(sorted(set(times))) or (np.inf,)
        keys = [_key(case, time) for time in series]
        different = list(dict.fromkeys(keys))
        numbers = tuple(different.index(key) for key in keys)
        if different == [_key(case, np.inf)]:
            return cls(series, (case,), numbers)
        first = [series[keys.index(key)] for key in different]
        return cls(series, tuple(case_at(case, time) for time in first), numbers)

    @classmethod
    def recorded(cls, case: Case) -> "Moments":
        """At which recordings are compared with a state; at the end alone where one goes on by itself."""
        return cls.of(case, () if goes_on(case) else recorded_times(case, ("fit", "check")))

    def number(self, time: float) -> int:
        """The number of the case at one of the times."""
        return self.numbers[self.times.index(time)]


def goes_on(case: Case) -> bool:
    """Whether a state changes in time while loads do not: stress relaxes, or fluid flows."""
    return any(mechanism.changes_by_itself for mechanism in case.mechanisms)


def recorded_times(case: Case, roles: Collection[str]) -> tuple[float, ...]:
    """Times [s] of the rows of recordings that are compared, and of their references, increasing."""
    times: set[float] = set()
    for recording in case.recordings:
        if recording.role in roles and len(rows := compared_rows(recording)):
            times |= set(times_of(recording)[rows].tolist())
            times |= set() if recording.reference is None else {recording.reference}
    return tuple(sorted(times))
