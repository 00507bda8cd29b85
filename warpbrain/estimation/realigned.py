"""Recordings moved back by an error of registration, so that points of a surface are compared with the right faces."""

from __future__ import annotations

from dataclasses import replace

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.estimation.registration import moved_back
from warpbrain.recordings.recording import PointsRecording, Recording, SurfaceRecording


def realigned(case: Case, motion: Floats, centre: Floats) -> Case:
    """The case as if its recordings had not been moved by a rigid motion.

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
    return replace(case, recordings=tuple(realigned_recording(one, motion, centre) for one in case.recordings))


def realigned_recording(recording: Recording, motion: Floats, centre: Floats) -> Recording:
    """The same of one recording: forces are as they were."""
    if isinstance(recording, PointsRecording):
        positions = recording.points + recording.displacement
        return replace(recording, displacement=moved_back(positions, motion, centre) - recording.points)
    if isinstance(recording, SurfaceRecording):
        return replace(recording, points=moved_back(recording.points, motion, centre))
    return recording
