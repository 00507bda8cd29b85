"""Every recording of a case beside a simulated state."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.boundary import Forced
from warpbrain.cases.case import Case
from warpbrain.errors import InputError
from warpbrain.mesh import TetMesh
from warpbrain.recordings.comparison import Comparison, compare_force, compare_points, compare_surface
from warpbrain.recordings.recording import ForceRecording, PointsRecording, Recording, SurfaceRecording


class State(Protocol):
    """What recordings are compared with: a `warpbrain.simulation.result.Result`, or less than that."""

    @property
    def mesh(self) -> TetMesh:
        """The simulated mesh, undeformed."""

    @property
    def u(self) -> NDArray[np.float64]:
        """Displacement [m], shape (n, 3)."""

    @property
    def reactions(self) -> NDArray[np.float64]:
        """What holds the constrained components [N], shape (n, 3)."""


@dataclass(frozen=True)
class Observed:
    """Comparisons of a state.

    Attributes
    ----------
    comparisons : tuple of Comparison
        One for each recording that has something to say of the state.
    skipped : tuple of str
        Why the others have not, a sentence each.
    """

    comparisons: tuple[Comparison, ...]
    skipped: tuple[str, ...]


def observe(case: Case, result: State, time: float | None = None) -> Observed:
    """Compare a state with the recordings of its case.

    Parameters
    ----------
    case : Case
    result : State
        Of the case's model.
    time : float, optional
        Of the state [s]; None for a state at rest, which is compared with the end of each recording. A recording
        without times is one of the end, and compared with whatever state there is.
    """
    comparisons, skipped = [], []
    for recording in case.recordings:
        at = None if getattr(recording, "time", None) is None else time
        try:
            comparisons.append(_compare(case, recording, result, at))
        except InputError as error:
            skipped.append(f"{error}")
        if isinstance(recording, ForceRecording) and recording.torque is not None:
            skipped.append(f"torque of '{recording.name}': a boundary has no axis that it could be about")
    return Observed(tuple(comparisons), tuple(skipped))


def _compare(case: Case, recording: Recording, result: State, time: float | None) -> Comparison:
    if isinstance(recording, PointsRecording):
        return compare_points(recording, result.mesh, result.u, time)
    if isinstance(recording, SurfaceRecording):
        return compare_surface(recording, result.mesh, result.u, time)
    assert isinstance(recording, ForceRecording)  # tests belong to specimens, which have no such state
    return compare_force(recording, _resultant(case, recording, result, time), time)


def _resultant(case: Case, recording: ForceRecording, result: State, time: float | None) -> NDArray[np.float64]:
    """Force (3,) [N] with which the recording's boundary acts on the tissue."""
    boundary = case.boundary(recording.boundary)
    if isinstance(boundary, Forced):
        times, factors = zip(*boundary.ramp, strict=True) if boundary.ramp else ((0.0,), (1.0,))
        return np.interp(math.inf if time is None else time, times, factors) * np.array(boundary.total)
    return np.asarray(result.reactions[result.mesh.node_sets[boundary.nodes]].sum(axis=0))
