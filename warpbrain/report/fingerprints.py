"""Which files a result came from: their SHA-256."""

from __future__ import annotations

import hashlib
from pathlib import Path

from warpbrain.cases.case import Case
from warpbrain.recordings.recording import PointsRecording


def fingerprints(case: Case) -> dict[str, str]:
    """SHA-256 of `case.toml`, mesh and recordings, by their names in the case folder; of those that are there."""
    files = [case.path.name, case.mesh_file]
    for recording in case.recordings:
        files.append(recording.file)
        if isinstance(recording, PointsRecording) and recording.moved_file is not None:
            files.append(recording.moved_file)
    return {name: _hash(case.folder / name) for name in dict.fromkeys(files) if name and (case.folder / name).is_file()}


def fingerprint_of(case: Case, *others: str) -> str:
    """Twelve digits that change when a file of the case, its laws or something else that is named changes."""
    laws = [
        f"{label}: {tissue.model} {tissue.formulation} {tissue.prior}" for label, tissue in sorted(case.tissues.items())
    ]
    text = "\n".join([*(f"{name} {value}" for name, value in fingerprints(case).items()), *laws, *others])
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def _hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
