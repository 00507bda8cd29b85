"""Which rows of a recording a state is compared with."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.errors import InputError
from warpbrain.recordings.recording import (
    ForceRecording,
    PointsRecording,
    SurfaceRecording,
    TestRecording,
)

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]

AnyRecording = PointsRecording | SurfaceRecording | ForceRecording | TestRecording


def rows_at(recording: AnyRecording, time: float | None = None) -> Rows:
    """Rows that say what was so at a time.

    Without a time it is the end: every row of points or of a surface that has no times; of points with ids the last row
    of each; else the rows of the last time. At a time it is the rows of the recorded time nearest to it, the earlier of
    two, and of each id its own. They count if that is no farther away than half the median interval between the
    recording's times; a recording of one time must have that very time.

    Parameters
    ----------
    recording : PointsRecording, SurfaceRecording, ForceRecording or TestRecording
    time : float, optional
        [s]

    Returns
    -------
    (k,) int64 array
        Row numbers, increasing, at least one.

    Raises
    ------
    InputError
        If nothing was recorded at that time, or the recording has no times.
    """
    times = recording.time
    if times is None:
        if time is not None:
            raise InputError(f"recording '{recording.name}' has no times: it can be compared with an end state only")
        single = isinstance(recording, TestRecording)
        count = len(recording.imposed if isinstance(recording, TestRecording) else _rows(recording))
        return np.arange(count - 1 if single else 0, count)
    ids = recording.ids if isinstance(recording, PointsRecording) else None
    groups = np.zeros(len(times), dtype=np.int64) if ids is None else np.unique(ids, return_inverse=True)[1]
    apart = -times if time is None else np.abs(times - time)
    order = np.lexsort((times, apart, groups))
    nearest = times[order[np.unique(groups[order], return_index=True)[1]]]
    allowed = np.inf if time is None else _half_interval(times)
    rows = np.flatnonzero((times == nearest[groups]) & (apart <= allowed))
    if len(rows) == 0:
        span = f"{times.min():g} s to {times.max():g} s"
        raise InputError(f"recording '{recording.name}' has nothing at {time:g} s: its times are {span}")
    return rows


def _rows(recording: PointsRecording | SurfaceRecording | ForceRecording) -> Floats:
    return recording.force if isinstance(recording, ForceRecording) else recording.points


def _half_interval(times: Floats) -> float:
    steps = np.diff(np.unique(times))
    rounding = 1e-9 * float(np.abs(times).max())
    return (float(np.median(steps)) / 2.0 if len(steps) else 0.0) + rounding
