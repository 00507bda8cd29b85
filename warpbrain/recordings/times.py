"""Which rows of a recording a state is compared with."""

import numpy as np

from warpbrain.arrays import Floats, Ints
from warpbrain.errors import InputError
from warpbrain.recordings.base import Recording


def times_of(recording: Recording) -> Floats:
    """Time (n,) [s] of each row; infinite, the end, where a recording has no times."""
    times = recording.time
    return np.full(recording.count, np.inf) if times is None else np.asarray(times, dtype=np.float64)


def compared_rows(recording: Recording) -> Ints:
    """Numbers (k,) of the rows that states are compared with, in the order of their times.

    Not of the time 0 or earlier, when nothing acts yet, nor of the time of the reference, which differs from itself by
    nothing; nor tracked points of weight zero.
    """
    times = times_of(recording)
    counts = times > 0.0
    if recording.reference is not None:
        counts &= times != recording.reference
    weights = getattr(recording, "weights", None)
    if weights is not None:
        counts &= weights != 0.0
    rows = np.flatnonzero(counts)
    return np.asarray(rows[np.argsort(times[rows], kind="stable")], dtype=np.int64)


def rows_at(recording: Recording, time: float | None = None) -> Ints:
    """Rows that say what was so at a time.

    Without a time it is the end: every row of points or of a surface that has no times; of points with ids the last row
    of each; else the rows of the last time. At a time it is the rows of the recorded time nearest to it, the earlier of
    two, and of each id its own. They count if that is no farther away than half the median interval between the
    recording's times; a recording of one time must have that very time.

    `time` [s]. Returns (k,): row numbers, increasing, at least one. `InputError` if nothing was recorded at that time,
    or the recording has no times.
    """
    times = recording.time
    if times is None:
        if time is not None:
            raise InputError(f"recording '{recording.name}' has no times: it can be compared with an end state only")
        return np.arange(recording.count - 1 if recording.of_specimen else 0, recording.count)
    ids = getattr(recording, "ids", None)
    groups = np.zeros(len(times), dtype=np.int64) if ids is None else np.unique(ids, return_inverse=True)[1]
    apart = -times if time is None else np.abs(times - time)
    order = np.lexsort((times, apart, groups))
    nearest = times[order[np.unique(groups[order], return_index=True)[1]]]
    allowed = np.inf
    if time is not None:
        steps = np.diff(np.unique(times))
        allowed = (float(np.median(steps)) / 2.0 if len(steps) else 0.0) + 1e-9 * float(np.abs(times).max())
    rows = np.flatnonzero((times == nearest[groups]) & (apart <= allowed))
    if len(rows) == 0:
        span = f"{times.min():g} s to {times.max():g} s"
        raise InputError(f"recording '{recording.name}' has nothing at {time:g} s: its times are {span}")
    return rows
