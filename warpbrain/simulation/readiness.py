"""Can a case be simulated? What `warpbrain cases check` says beside what is wrong with the files."""

from __future__ import annotations

from warpbrain.cases.case import Case
from warpbrain.errors import InputError
from warpbrain.recordings.recording import TestRecording
from warpbrain.simulation.held import require_held
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.specimen import not_transmitted, specimen_of


def why_not(case: Case) -> str:
    """Why a sound case cannot be run as it stands; empty if it can."""
    try:
        if case.specimen is None:
            require_held(model_of(case))
            return ""
        specimen_of(case)
        for tissue in case.tissues.values():
            _ = tissue.known_law
    except InputError as error:
        return str(error).removeprefix(f"{case.path}: ")
    for recording in case.recordings:
        if isinstance(recording, TestRecording) and (why := not_transmitted(case.specimen.grips, recording.mode)):
            return f"recording '{recording.name}' mode '{recording.mode}': {why}"
    return ""
