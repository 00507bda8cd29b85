"""Every recording of a case beside simulated states."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from warpbrain.arrays import Floats, Ints
from warpbrain.cases.boundary import Forced
from warpbrain.cases.case import Case
from warpbrain.cases.moments import Moments, goes_on
from warpbrain.errors import InputError, require_kind
from warpbrain.physics.load import Ramped
from warpbrain.recordings.comparison import Comparison, compare_force, compare_points, compare_surface, joined
from warpbrain.recordings.recording import ForceRecording, PointsRecording, Recording, SurfaceRecording
from warpbrain.recordings.times import compared_rows, rows_at, times_of
from warpbrain.simulation.result import NodalState, Result

#: What recordings are compared with.
State = NodalState | Result


@dataclass(frozen=True)
class Observed:
    """Comparisons of a state."""

    comparisons: tuple[Comparison, ...]  # one for each recording that has something to say of the state
    skipped: tuple[str, ...]  # why the others have not, a sentence each


def observe(
    case: Case, result: State, time: float | None = None, others: Mapping[float, State] | None = None
) -> Observed:
    """Compare states with the recordings of their case.

    Every row is compared with the state of its time, less that of its recording's reference. A row without a time is
    one of the end.

    Parameters
    ----------
    case : Case
    result : State
        Of the case's model.
    time : float, optional
        Of the state [s]; None for a state at rest long after everything.
    others : mapping of float to State, optional
        States of earlier times. Without them, rows of other times are compared with the state at rest if what acts then
        is the same; the end of a motion with the rows of its own time alone.
    """
    require_kind(case, Case, "case", "a Case, as warpbrain.find_case gives")
    comparisons, skipped = [], []
    for recording in case.recordings:
        state_of = partial(_state_at, case, recording, result, time, others or {})
        try:
            groups = _rows_by_time(case, recording, time, others or {})
            before = None if recording.reference is None else state_of(recording.reference)
            comparisons.append(
                joined([_compared(case, recording, state_of(at), at, before, rows) for at, rows in groups])
            )
        except InputError as error:
            skipped.append(f"{error}")
        if isinstance(recording, ForceRecording) and recording.torque is not None:
            skipped.append(f"torque of '{recording.name}': a boundary has no axis that it could be about")
    return Observed(tuple(comparisons), tuple(skipped))


def _rows_by_time(
    case: Case, recording: Recording, time: float | None, states: Mapping[float, State]
) -> list[tuple[float, Ints]]:
    """Rows of a recording that are compared, by the time of the state that they are compared with."""
    assert isinstance(recording, PointsRecording | SurfaceRecording | ForceRecording)
    times = times_of(recording)
    rows = compared_rows(recording)
    if recording.time is None:
        return [(math.inf, rows_at(recording))]
    if time is not None:
        rows = rows[np.isin(times[rows], [*states, time])]
        if not (states and len(rows)):
            return [(time, rows_at(recording, time))]
    elif goes_on(case):
        return [(math.inf, rows_at(recording))]
    elif not states:
        moments = Moments.of(case, {*times[rows].tolist(), math.inf})
        last = moments.number(math.inf)
        rows = rows[[moments.number(at) == last for at in times[rows].tolist()]]
    if not len(rows):
        raise InputError(
            f"recording '{recording.name}' has nothing of a time at which what acts is as it is in the end"
        )
    return [(at, rows[times[rows] == at]) for at in np.unique(times[rows]).tolist()]


def _state_at(
    case: Case, recording: Recording, result: State, time: float | None, states: Mapping[float, State], at: float
) -> State:
    """The state of a time; `InputError` if it is not known."""
    if at in states:
        return states[at]
    if math.isinf(at) or at == time:
        return result
    if time is None and not goes_on(case):
        moments = Moments.of(case, (at, math.inf))
        if len(moments.cases) == 1:
            return result
    raise InputError(
        f"recording '{recording.name}' is counted from the state at {at:g} s, which this run does not compute"
    )


def _compared(
    case: Case, recording: Recording, state: State, time: float, before: State | None, rows: Ints
) -> Comparison:
    u = state.u if before is None else state.u - before.u
    if isinstance(recording, PointsRecording):
        return compare_points(recording, state.mesh, u, rows)
    if isinstance(recording, SurfaceRecording):
        return compare_surface(recording, state.mesh, u, rows)
    assert isinstance(recording, ForceRecording)  # tests belong to specimens, which have no such state
    force = _resultant(case, recording, state, time)
    if before is not None:
        assert recording.reference is not None
        force = force - _resultant(case, recording, before, recording.reference)
    return compare_force(recording, force, rows)


def _resultant(case: Case, recording: ForceRecording, result: State, time: float) -> Floats:
    """Force (3,) [N] with which the recording's boundary acts on the tissue."""
    boundary = case.boundary(recording.boundary)
    if isinstance(boundary, Forced):
        return Ramped(ramp=boundary.ramp).factor(time) * np.array(boundary.total)
    return np.asarray(result.reactions[result.mesh.node_sets[boundary.nodes]].sum(axis=0))
