"""When a test that depends on its history is computed: its record as a polygon over time, in short enough steps.

The corners of the polygon are rows of the record, chosen so that it misses no row by more than a part of the largest
imposed value (Douglas and Peucker 1973, Cartographica 10, 112): what is imposed goes straight from corner to corner, as
a machine does it, without the jitter of its reading. Where it moves, a side is cut into equal steps; where it rests,
into steps that grow, since what relaxes does so ever more slowly. Ramps of what acts have corners of their own.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpbrain.arrays import Floats, Ints

#: How far the polygon may miss a row, relative to the largest imposed value.
MISSED = 0.005
#: First step of a rest, relative to the shortest time of relaxation; and by how much each is longer than the last.
FIRST, GROWTH = 0.25, 1.5
#: A moving side has steps no longer than that first one, but at most so many for each that an elastic test would take.
SHORTER = 4


@dataclass(frozen=True, eq=False)
class History:
    """States to compute."""

    time: Floats  # (k,), increasing; the first is that of the first row
    imposed: Floats  # (k,)
    corners: Ints  # (c,), which of them are corners of the polygon, the first and the last among them

    def interpolated(self, response: Floats, time: Floats) -> Floats:
        """A computed response (k,) at any times between the first and the last; smooth between corners, not at them."""
        from scipy.interpolate import PchipInterpolator

        values = np.full(len(time), response[0])
        for a, b in zip(self.corners[:-1], self.corners[1:], strict=True):
            within = (time >= self.time[a]) & (time <= self.time[b])
            curve = PchipInterpolator(self.time[a : b + 1], response[a : b + 1])
            values[within] = curve(time[within])
        return values


def history_of(
    time: Floats,
    imposed: Floats,
    reach: float,
    steps: int,
    shortest: float | None,
    ramps: Sequence[Sequence[float]] = (),
) -> History:
    """The states of a record: its rows `time` (n,) [s], increasing, and `imposed` (n,).

    `reach` is the largest distance of an imposed value from rest; a side as long as that, or within a ramp, is cut into
    `steps` at least. `shortest` is the shortest time of relaxation [s]; None: nothing relaxes, and a rest is one step.
    `ramps` are times [s] of the corners of what acts with a ramp.
    """
    rows = corners_of(time, imposed, MISSED * reach)
    turns = [t for ramp in ramps for t in ramp if time[0] < t < time[-1]]
    ends = np.unique(np.concatenate([time[rows], turns]))
    heights = np.interp(ends, time[rows], imposed[rows])
    times, values, corners = [ends[:1]], [heights[:1]], [0]
    for (t, x), (end, y) in itertools.pairwise(zip(ends, heights, strict=True)):
        ramped = any(ramp[0] <= t and end <= ramp[-1] for ramp in ramps)
        share = _shares(end - t, abs(y - x) / reach, steps, shortest, ramped)
        times.append(t + share * (end - t))
        values.append(x + share * (y - x))
        corners.append(corners[-1] + len(share))
    return History(np.concatenate(times), np.concatenate(values), np.array(corners))


def _shares(lasts: float, moves: float, steps: int, shortest: float | None, ramped: bool) -> Floats:
    """Where the steps of a side end, as shares of it, in (0, 1]; `moves` is relative to the reach."""
    first = 1.0 if shortest is None else min(1.0, FIRST * shortest / lasts)
    if ramped or moves > MISSED:
        least = steps if ramped else int(np.ceil(steps * moves - 1e-9))
        count = max(1, least, min(SHORTER * steps, int(np.ceil(1.0 / first))) if shortest is not None else 1)
        return np.arange(1, count + 1) / count
    if first == 1.0:
        return np.ones(1)
    return np.geomspace(first, 1.0, 1 + int(np.ceil(np.log(1.0 / first) / np.log(GROWTH))))


def corners_of(time: Floats, imposed: Floats, tolerance: float) -> Sequence[int]:
    """Rows between which the record is straight, the first and the last among them."""
    kept = {0, len(time) - 1}
    sides = [(0, len(time) - 1)]
    while sides:
        a, b = sides.pop()
        if b - a < 2:
            continue
        inner = slice(a + 1, b)
        missed = np.abs(imposed[inner] - np.interp(time[inner], time[[a, b]], imposed[[a, b]]))
        worst = int(np.argmax(missed))
        if missed[worst] > tolerance:
            kept.add(a + 1 + worst)
            sides += [(a, a + 1 + worst), (a + 1 + worst, b)]
    return sorted(kept)
