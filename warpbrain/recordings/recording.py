"""The kinds of recordings: what was observed, as plain data in SI units and RAS axes.

A kind is a file with a class of its own that derives from `Recording`, and its place in `RECORDINGS`.
"""

from __future__ import annotations

from warpbrain.recordings.base import Recording, TrackedPoints
from warpbrain.recordings.force import ForceRecording
from warpbrain.recordings.points import PointsRecording
from warpbrain.recordings.surface import SurfaceRecording
from warpbrain.recordings.test import TestRecording, turn_of

__all__ = [
    "RECORDINGS",
    "ForceRecording",
    "PointsRecording",
    "Recording",
    "SurfaceRecording",
    "TestRecording",
    "TrackedPoints",
    "turn_of",
]

#: By the names that `case.toml` gives them.
RECORDINGS: dict[str, type[Recording]] = {
    kind.kind: kind for kind in (PointsRecording, SurfaceRecording, ForceRecording, TestRecording)
}
