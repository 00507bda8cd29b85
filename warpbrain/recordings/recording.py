"""The kinds of recordings: what was observed, as plain data in SI units and RAS axes.

A kind is a file with a class of its own that derives from `Recording`, and its place in `RECORDINGS`.
"""

from warpbrain.recordings.base import Recording as Recording
from warpbrain.recordings.base import TrackedPoints as TrackedPoints
from warpbrain.recordings.force import ForceRecording as ForceRecording
from warpbrain.recordings.points import PointsRecording as PointsRecording
from warpbrain.recordings.surface import SurfaceRecording as SurfaceRecording
from warpbrain.recordings.test import TestRecording as TestRecording

#: By the names that `case.toml` gives them.
RECORDINGS: dict[str, type[Recording]] = {
    kind.kind: kind for kind in (PointsRecording, SurfaceRecording, ForceRecording, TestRecording)
}
