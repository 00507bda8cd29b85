"""A case in words: all that it says, and what checking it found."""

from __future__ import annotations

import numpy as np

from warpbrain.cases.case import Case
from warpbrain.cases.checking import Checked
from warpbrain.mesh import measure
from warpbrain.physics.words import length
from warpbrain.recordings.recording import (
    ForceRecording,
    PointsRecording,
    Recording,
    SurfaceRecording,
    TestRecording,
    count_of,
)
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.page import lines
from warpbrain.report.summary import SET_TITLES, STAND_IN


def recording_line(recording: Recording) -> str:
    """One line about a recording."""
    head = f"{recording.name}: {count_of(recording)} "
    role = "" if recording.role == "fit" else "; only checked, never fitted"
    lengths = isinstance(recording, PointsRecording | SurfaceRecording)
    lengths |= isinstance(recording, TestRecording) and recording.answer[0] == "displacement"
    scale, unit = (MILLIMETRES, "mm") if lengths else (1.0, "")
    noise = f"; noise {scale * recording.sigma:g} {unit}".rstrip() if recording.sigma is not None else ""
    if isinstance(recording, PointsRecording):
        sizes = np.linalg.norm(recording.displacement, axis=1)
        rms, most = length(float(np.sqrt(np.mean(sizes**2)))), length(float(sizes.max()))
        return f"{head}tracked points, moved by {rms} RMS, {most} at most{noise}{role}"
    if isinstance(recording, SurfaceRecording):
        return f"{head}points of the moved surface '{recording.nodes}', not paired{noise}{role}"
    if isinstance(recording, ForceRecording):
        return f"{head}forces on '{recording.boundary}'{noise}{role}"
    assert isinstance(recording, TestRecording)
    return f"{head}rows of a test in {recording.mode}: {' and '.join(recording.quantities)}{noise}{role}"


def show_lines(case: Case) -> list[str]:
    """Everything a case says, as printed."""
    recorded = list(map(recording_line, case.recordings))
    return lines("case.txt", "show", case, measure(case.mesh), recorded, SET_TITLES, STAND_IN)


def check_lines(checked: Checked, cannot: str) -> list[str]:
    """What checking found, as printed: problems first; `cannot` says why a sound case cannot be run yet."""
    recorded = [] if checked.case is None else list(map(recording_line, checked.case.recordings))
    return lines("case.txt", "check", checked, cannot, recorded, SET_TITLES)
