"""What to measure next: by how much it would tell the two most probable causes apart.

A cause with its effect `g` on the sensors is told from another by the expected log Bayes factor over the best imitation
that the other can make, its size free:

    D = 1/2 ( |g|^2 - |P g|^2 )        in the metric of noise and nuisances
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.base import Base
from warpbrain.diagnosis.refitting import Refit
from warpbrain.diagnosis.result import Measurement
from warpbrain.diagnosis.screening import Screen
from warpbrain.worlds.body.dictionary import Candidates
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.sensors import spread_points

Floats = NDArray[np.float64]

#: Points of a further recording.
_POINTS = 25
#: Error of direct readings: a pressure [Pa].
_READING = {"pressure": (20.0, "a reading of the pressure, to 20 Pa")}


def next_measurements(
    base: Base,
    candidates: Candidates,
    screen: Screen,
    kinds: Sequence[str],
    fits: dict[str, Refit],
    kappa: float,
) -> tuple[Measurement, ...]:
    """Measurements in the order of what they tell about two kinds, the first of which is taken to be the cause."""
    if len(kinds) < 2:
        return ()
    first, second = (candidates.effects[screen.best_effect(candidates, kind)] for kind in kinds[:2])
    width = first.columns.shape[1]
    # of what was refined between places the amount alone: it is compared in its place of the scan
    z = fits[kinds[0]].coefficients[0][:width] if kinds[0] in fits else np.ones(width)
    noise = base.typical_noise
    columns = base.nuisances.columns
    found = [Measurement("nothing more", _apart(base, first, second, z, columns, kappa, None, noise))]
    found.append(
        Measurement(
            "the same points with half the noise", _apart(base, first, second, z, columns, 0.5 * kappa, None, noise)
        )
    )
    places = _places(base)
    further = _further(base, first, second, z, np.concatenate(list(places.values())))
    at = 0
    for name, where in places.items():
        rows = further[3 * at : 3 * (at + len(where))]
        at += len(where)
        what = f"{len(where)} more tracked points {name}"
        found.append(Measurement(what, _apart(base, first, second, z, columns, kappa, rows, noise)))
    for kind in kinds[:2]:
        if kind in _READING:
            error, what = _READING[kind]
            size = abs(z[0]) * first.proposed.sd[0] if kind == kinds[0] else second.proposed.sd[0]
            found.append(Measurement(what, found[0].expected_nats + 0.5 * (float(size) / error) ** 2))
    if "gravity" in kinds[:2]:
        # only gravity turns with the head: a second pose is a second experiment
        found.append(Measurement("the same points with the head turned by 30 degrees", 1.5 * found[0].expected_nats))
    return tuple(sorted(found, key=lambda one: -one.expected_nats))


def _places(base: Base) -> dict[str, Floats]:
    mesh = base.at.system.model.mesh
    found = {"throughout the tissue": mesh.centres[spread_points(mesh.centres, 0.0, _POINTS)]}
    still = base.at.system.model.constrained.all(axis=1)
    for name, members in mesh.node_sets.items():
        points = mesh.points[members & ~still]
        if len(points) >= _POINTS:
            found[f"on '{name}'"] = points[spread_points(points, 0.0, _POINTS)]
    return found


def _apart(
    base: Base,
    first: Effect,
    second: Effect,
    z: Floats,
    nuisances: Floats,
    kappa: float,
    further: Floats | None,
    noise: float,
) -> float:
    """Expected log Bayes factor of one effect over the best imitation by another, with more points or without."""
    scale = kappa * base.sigma
    effect = first.mean + first.columns @ z
    imitation = np.column_stack([second.mean, second.columns]) if second.mean.any() else second.columns
    rows: list[Any] = [np.column_stack([effect, imitation, nuisances]) / scale[:, None]]
    if further is not None:
        rows.append(further / noise)
    whole = np.concatenate(rows)
    count = imitation.shape[1]
    g, G, U = whole[:, 0], whole[:, 1 : 1 + count], whole[:, 1 + count :]
    inner = np.linalg.inv(np.eye(U.shape[1]) + U.T @ U)

    def left(X: Floats) -> Floats:
        return np.asarray(X - U @ (inner @ (U.T @ X)))

    Lg = left(g)
    M = G.T @ left(G)
    M += 1e-10 * max(float(np.trace(M)), 1e-300) * np.eye(count)
    b = G.T @ Lg
    return 0.5 * max(float(g @ Lg - b @ np.linalg.solve(M, b)), 0.0)


def _further(base: Base, first: Effect, second: Effect, z: Floats, where: Floats) -> Floats:
    """Rows of tracked points at other places (k, 3) [m]: the effect, its imitation, nuisances."""
    nuisances, effects = base.elsewhere(where)
    there, imitation = effects.of([first.proposed, second.proposed])
    columns = np.column_stack([imitation.mean, imitation.columns]) if second.mean.any() else imitation.columns
    return np.column_stack([there.mean + there.columns @ z, columns, nuisances.columns])
