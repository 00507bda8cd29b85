"""How many numbers a case's recordings hold, and whether these are enough: the one count that all commands share."""

from __future__ import annotations

import math

from warpbrain.cases.boundary import Forced
from warpbrain.cases.case import Case
from warpbrain.recordings.points import distinct_rows
from warpbrain.recordings.recording import ForceRecording, PointsRecording, Recording
from warpbrain.recordings.times import compared_rows

#: Noise can be estimated from no fewer numbers than this.
_FOR_NOISE = 10
#: Numbers below which nothing but registration and stiffness can be told: a dozen, and one point more.
_TO_DIAGNOSE = 15


def numbers_in(case: Case, recording: Recording) -> int:
    """Numbers of a recording that tell of a body: every component of every row, at all times; copies tell no more.

    The resultant of a boundary whose force the case gives tells nothing.
    """
    if isinstance(recording, ForceRecording) and isinstance(case.boundary(recording.boundary), Forced):
        return 0
    rows = compared_rows(recording)
    if isinstance(recording, PointsRecording):
        rows, _ = distinct_rows(recording, rows)
    return recording.components * len(rows)


def numbers_to_fit(case: Case) -> int:
    """Numbers of all recordings to which a body is fitted."""
    return sum(numbers_in(case, recording) for recording in case.recordings if recording.role == "fit")


def too_few_for_noise(case: Case, recording: Recording) -> str:
    """Why the noise of a recording cannot be estimated; empty if it can, or is declared."""
    declared = recording.sigma is not None or getattr(recording, "sigmas", None) is not None
    count = numbers_in(case, recording)
    if declared or not 0 < count < _FOR_NOISE:
        return ""
    return (
        f"recording '{recording.name}' holds {count} numbers: too few to estimate their noise from, which takes "
        f"{_FOR_NOISE}; give its sigma"
    )


def too_few_to_diagnose(case: Case) -> str:
    """Why nothing can be concluded from what a body's case has to fit; empty if something can."""
    count = numbers_to_fit(case)
    if count >= _TO_DIAGNOSE:
        return ""
    points = math.ceil((_TO_DIAGNOSE - count) / 3)
    return (
        f"[[recording]] role = 'fit': {count} numbers: too few for any conclusion, since registration and stiffness "
        f"alone take a dozen; {points} more tracked points, spread over the body, or as many more times would do"
    )
