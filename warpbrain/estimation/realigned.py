"""Recordings moved back by an error of registration, so that points of a surface are compared with the right faces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.case import Case
from warpbrain.estimation.registration import rigid_columns
from warpbrain.recordings.recording import PointsRecording, Recording, SurfaceRecording

Floats = NDArray[np.float64]


def realigned(case: Case, motion: Floats, centre: Floats) -> Case:
    """The case as if its recordings had not been moved by a small rigid motion.

    Parameters
    ----------
    case : Case
    motion : (6,) array
        Shift [m] and turn [rad], as in `warpbrain.estimation.registration`.
    centre : (3,) array
        Of the turn [m].
    """
    if not motion.any():
        return case
    return replace(case, recordings=tuple(_moved_back(one, motion, centre) for one in case.recordings))


def _moved_back(recording: Recording, motion: Floats, centre: Floats) -> Recording:
    if isinstance(recording, PointsRecording):
        moved = recording.points + recording.displacement
        return replace(recording, displacement=recording.displacement - rigid_columns(moved, centre) @ motion)
    if isinstance(recording, SurfaceRecording):
        return replace(recording, points=recording.points - rigid_columns(recording.points, centre) @ motion)
    return recording
