"""Errors at recordings with role `check`, to which nothing is fitted."""

from __future__ import annotations

import math
from collections.abc import Sequence

from warpbrain.cases.case import Case
from warpbrain.diagnosis.held_out import distance
from warpbrain.errors import SolveError
from warpbrain.estimation.finer_mesh import Difference
from warpbrain.estimation.observations import Observations
from warpbrain.estimation.registration import realigned
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.mesh_error import MeshErrors, expected
from warpbrain.worlds.body.refit import Refit
from warpbrain.worlds.body.sensors import sensors_at


def check_errors(case: Case, base: Base, fits: Sequence[Refit]) -> tuple[float, ...] | None:
    """Root mean square distances [m]: of the case as declared, then of each fit; None if there is nothing to check.

    A fit predicts them by its state, the expected error of the mesh, and its nuisances: an error of registration is the
    same for recordings that are fitted and for others.
    """
    checks = Observations.to_check(case)
    if all(observation.kind == "force" for observation in checks.recordings):
        return None
    centre, declared = base.states.centre, base.declared
    sensors = sensors_at([(math.inf, checks, declared.u, declared.reactions)], centre)
    # fits are to realigned recordings, see `realigned`
    realigned_checks = Observations.to_check(realigned(case, base.states.motion, centre))
    return distance(sensors, sensors.residual), *(_error(realigned_checks, base, fit) for fit in fits)


def _error(checks: Observations, base: Base, fit: Refit) -> float:
    """Root mean square distance [m] of a fit."""
    u, reactions = fit.state.u, fit.state.reactions
    if base.mesh_errors is not None:
        error = _mesh_error(base, base.mesh_errors, fit)
        u, reactions = u + error.u, reactions + error.reactions
    sensors = sensors_at([(math.inf, checks, u, reactions)], base.states.centre)
    nuisances, _ = base.for_sensors(sensors)
    # less tissue and field, which the state has, and the motion by which recordings were realigned
    coordinates = nuisances.coordinates(base.prior, fit.state.hypothesis)
    coordinates[nuisances.part("registration")] = base.states.motion_coordinates
    linear = fit.nuisances[: len(coordinates)] - coordinates
    residual = sensors.residual - nuisances.columns @ linear
    return distance(sensors, residual)


def _mesh_error(base: Base, known: MeshErrors, fit: Refit) -> Difference:
    """The expected error of the mesh, with that of mechanisms where a finer mesh can be solved."""
    hypothesis = fit.state.hypothesis
    if not any(effect.proposed.changes_in_time for effect in fit.effects):
        try:
            return expected(known.finer.error(hypothesis, fit.state))
        except SolveError:
            pass
    return expected(known.of(hypothesis, base.prior))
