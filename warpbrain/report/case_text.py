"""A case in words: all that it says, what checking it found, and what there is to a new one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from warpbrain.cases.case import Case
from warpbrain.cases.checking import Checked
from warpbrain.mesh import measure
from warpbrain.recordings.recording import Recording
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.page import lines
from warpbrain.report.summary import SET_TITLES, STAND_IN

if TYPE_CHECKING:
    from warpbrain.cases.starting import StartedCase


def recording_line(recording: Recording) -> str:
    """One line about a recording."""
    role = "" if recording.role == "fit" else "; only checked, never fitted"
    scale, unit = (MILLIMETRES, "mm") if recording.noise_unit == "m" else (1.0, "")
    noise = f"; noise {scale * recording.sigma:g} {unit}".rstrip() if recording.sigma is not None else ""
    return f"{recording.name}: {recording.content}{noise}{role}"


def show_lines(case: Case) -> list[str]:
    """Everything a case says, as printed."""
    recorded = list(map(recording_line, case.recordings))
    return lines("case.txt", "show", case, measure(case.mesh), recorded, SET_TITLES, STAND_IN)


def check_lines(checked: Checked, cannot: str) -> list[str]:
    """What checking found, as printed: problems first; `cannot` says why a sound case cannot be run yet."""
    recorded = [] if checked.case is None else list(map(recording_line, checked.case.recordings))
    return lines("case.txt", "check", checked, cannot, recorded, SET_TITLES)


def started_lines(started: StartedCase) -> list[str]:
    """What a user should read about a new case, as printed."""
    return lines("case.txt", "started", started)
