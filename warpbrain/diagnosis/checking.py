"""Errors at recordings with role `check`, to which nothing is fitted: each at its time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from warpbrain.arrays import Floats, Ints
from warpbrain.cases.case import Case
from warpbrain.cases.moments import Moments
from warpbrain.diagnosis.confirming import distance
from warpbrain.errors import SolveError
from warpbrain.estimation.finer_mesh import Difference
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.fit_columns import with_laws_about
from warpbrain.worlds.body.mesh_error import MeshErrors, expected
from warpbrain.worlds.body.nuisances import RigidMotion
from warpbrain.worlds.body.refit import Refit
from warpbrain.worlds.body.sensors import Sensors
from warpbrain.worlds.body.states import SolvedState, States
from warpbrain.worlds.body.time_courses import finite_times


def check_errors(case: Case, base: Base, fits: Sequence[Refit]) -> tuple[float, ...] | None:
    """Root mean square distances [m]: of the case as declared, then of each fit; None if there is nothing to check.

    A fit predicts them by its state at their times, the expected error of the mesh, and its nuisances: an error of
    registration is the same for recordings that are fitted and for others.
    """
    if all(recording.kind == "force" for recording in case.recordings if recording.role == "check"):
        return None
    checks = States(case, base.states.device, "check")
    checks.centre = base.states.centre
    declared = _sensors(checks, base.declared, None)
    # fits are to realigned recordings, see `realigned`
    checks.realign(base.states.motion)
    return distance(declared, declared.residual), *(_error(checks, base, fit) for fit in fits)


def _error(checks: States, base: Base, fit: Refit) -> float:
    """Root mean square distance [m] of a fit."""
    error = None if base.mesh_errors is None else _mesh_error(base, base.mesh_errors, fit)
    sensors = _sensors(checks, fit.state, error)
    at_times = _at_nearest_times(sensors, base.states.times)
    nuisances, _ = base.for_sensors(at_times)
    columns = with_laws_about(fit, nuisances, at_times, base)
    rigid = RigidMotion(checks, nuisances)
    # less tissue and field, which the state has
    linear = fit.nuisances[: nuisances.columns.shape[1]] - nuisances.coordinates(base.prior, fit.state.hypothesis)
    linear[rigid.part] = 0.0
    residual = sensors.residual - columns @ linear
    return distance(sensors, residual + rigid.change(sensors, fit.nuisances))


def _sensors(checks: States, state: SolvedState, error: Difference | None) -> Sensors:
    """What is checked beside a state; at times at which something else acts, beside the states of these."""
    case = checks.case_of(state.hypothesis)
    moments = Moments.of(case, checks.times)
    ended = moments.cases[0] is case and not state.course and len({id(i.system) for i in state.instants}) == 1
    if ended or checks.times == (math.inf,):
        instants = tuple(replace(state.instants[-1], time=time) for time in checks.times)
        return checks.corrected(replace(state, instants=instants), error).sensors
    return checks.solve(state.hypothesis, state.u, error).sensors


def _at_nearest_times(sensors: Sensors, times: Sequence[float]) -> Sensors:
    """The rows as if their states were those of the nearest of some times [s]: what is linear about these is alike."""

    def nearest(wanted: Floats) -> Ints:
        ranks = np.concatenate([np.array(times), wanted])
        finite = finite_times(ranks)
        return np.abs(finite[len(times) :, None] - finite[: len(times)]).argmin(axis=1)

    if times == (math.inf,):
        return replace(sensors, after=np.zeros_like(sensors.after), before=np.full_like(sensors.before, -1))
    before = np.where(sensors.before < 0, -1, nearest(sensors.references))
    return replace(sensors, after=nearest(sensors.times), before=before)


def _mesh_error(base: Base, known: MeshErrors, fit: Refit) -> Difference:
    """The expected error of the mesh, with that of mechanisms where a finer mesh can be solved."""
    hypothesis = fit.state.hypothesis
    if not any(effect.proposed.changes_in_time for effect in fit.effects):
        try:
            return expected(known.finer.error(hypothesis, fit.state))
        except SolveError:
            pass
    return expected(known.of(hypothesis, base.prior))
