"""What to measure next: by how much it would discriminate between the two most probable causes.

The measure is the expected log Bayes factor of a cause with the effect `g` on the sensors over the best approximation
by the other cause, whose size is free:

    D = 1/2 ( |g|^2 - |P g|^2 )        in the metric of noise and nuisances, P the projection on the other's columns
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference import GaussianModel
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.values import Measurement
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.sensors import spread_points
from warpbrain.worlds.body.weighted_set import WeightedSet

#: Points of a further recording.
_POINTS = 25
#: By how much the head is turned for another one [degrees], and about which axes of the body.
_TURN = 30.0
_AXES = ("left-right", "front-back", "head-foot")


def next_measurements(
    base: Base, first: WeightedSet, second: WeightedSet, names: tuple[str, str]
) -> tuple[Measurement, ...]:
    """Measurements in the order of how they discriminate between two mechanisms, the first of which is taken for true.

    Parameters
    ----------
    base : Base
    first, second : WeightedSet
        Sets with the first and with the second mechanism.
    names : (str, str)
    """
    pairs = zip((first, second), names, strict=True)
    effects = tuple(weighted_set.effects[weighted_set.mechanisms.index(name)] for weighted_set, name in pairs)
    z = first.coefficients[first.mechanisms.index(names[0])][0]
    discrimination = _Discrimination(base, effects[0], effects[1], z, first.marginal.scale)
    measurements = [
        Measurement("nothing more", discrimination.as_recorded()),
        Measurement("the same points with half the noise", discrimination.as_recorded(0.5)),
    ]
    places = _places(base)
    further = _further(base, effects[0], effects[1], z, np.concatenate(list(places.values())))
    at = 0
    for name, points in places.items():
        rows = further[3 * at : 3 * (at + len(points))]
        at += len(points)
        measurements.append(Measurement(f"{len(points)} more tracked points {name}", discrimination.with_rows(rows)))
    registry = mechanisms()
    for name, effect in zip(names, effects, strict=True):
        reading = registry[name].reading
        if reading is not None:
            size = abs(z[0]) * effect.proposed.sd[0] if name == names[0] else effect.proposed.sd[0]
            expected_nats = measurements[0].expected_nats + 0.5 * (float(size) / reading.error) ** 2
            measurements.append(Measurement(reading.words, expected_nats))
    measurements += [
        Measurement(f"the same points with the head turned {words}", expected_nats)
        for words, expected_nats in discrimination.turned()
    ]
    return tuple(sorted(measurements, key=lambda measurement: -measurement.expected_nats))


def _places(base: Base) -> dict[str, Floats]:
    mesh = base.at.system.model.mesh
    places = {"throughout the tissue": mesh.centres[spread_points(mesh.centres, 0.0, _POINTS)]}
    still = base.at.system.model.constrained.all(axis=1)
    for name, members in mesh.node_sets.items():
        points = mesh.points[members & ~still]
        if len(points) >= _POINTS:
            places[f"on '{name}'"] = points[spread_points(points, 0.0, _POINTS)]
    return places


class _Discrimination:
    """Expected log Bayes factor of one effect over its best approximation by another."""

    def __init__(self, base: Base, first: Effect, second: Effect, z: Floats, scale: float) -> None:
        self._base, self._effects, self._z, self._scale = base, (first, second), z, scale
        self._rows = np.column_stack([first.mean + first.columns @ z, _columns_of(second), base.nuisances.columns])
        self._second_width = _columns_of(second).shape[1]

    def as_recorded(self, noise: float = 1.0) -> float:
        """With the recorded rows, their noise so many times as large."""
        factor = noise * self._base.model.noise_factor
        return self._expected_nats(
            GaussianModel(factor, self._rows[:, 1 + self._second_width :], self._scale), self._rows
        )

    def with_rows(self, further: Floats) -> float:
        """With further rows (m, 1 + k + q)."""
        n, m = len(self._rows), len(further)
        factor = np.zeros((n + m, n + m))
        factor[:n, :n] = self._base.model.noise_factor
        factor[n:, n:] = self._base.typical_noise * np.eye(m)
        whole = np.concatenate([self._rows, further])
        return self._expected_nats(GaussianModel(factor, whole[:, 1 + self._second_width :], self._scale), whole)

    def turned(self) -> list[tuple[str, float]]:
        """With the same points again after the best turn of the head; empty if both effects turn with the body.

        Tissue is the same in both poses; each pose has its own error of registration.
        """
        from scipy.spatial.transform import Rotation

        measurements = []
        for axis, words in enumerate(_AXES):
            rotation = Rotation.from_rotvec(np.radians(_TURN) * np.eye(3)[axis]).as_matrix()
            effects = [_turned(self._base, effect, rotation) for effect in self._effects]
            if all(turned_effect is effect for turned_effect, effect in zip(effects, self._effects, strict=True)):
                return []
            nuisances = self._base.nuisances
            second_registration = np.zeros_like(nuisances.columns)
            registration = nuisances.part("registration")
            second_registration[:, registration] = nuisances.columns[:, registration]
            first = np.column_stack([self._rows, np.zeros_like(second_registration)])
            second = np.column_stack(
                [
                    effects[0].mean + effects[0].columns @ self._z,
                    _columns_of(effects[1]),
                    nuisances.columns,
                    second_registration,
                ]
            )
            second[:, 1 + self._second_width :][:, registration] = 0.0
            rows = np.concatenate([first, second])
            factor: Floats = np.kron(np.eye(2), self._base.model.noise_factor).astype(np.float64)
            expected_nats = self._expected_nats(
                GaussianModel(factor, rows[:, 1 + self._second_width :], self._scale), rows
            )
            measurements.append((f"by {_TURN:g} degrees about its {words} axis", expected_nats))
        return [max(measurements, key=lambda measurement: measurement[1])]

    def _expected_nats(self, model: GaussianModel, rows: Floats) -> float:
        white = model.standardised(rows[:, : 1 + self._second_width])
        g, G = white[:, 0], white[:, 1:]
        M = G.T @ G
        M += 1e-10 * max(float(np.trace(M)), 1e-300) * np.eye(len(M))
        b = G.T @ g
        return 0.5 * max(float(g @ g - b @ np.linalg.solve(M, b)), 0.0)


def _columns_of(effect: Effect) -> Floats:
    return np.column_stack([effect.mean, effect.columns]) if effect.mean.any() else effect.columns


def _turned(base: Base, effect: Effect, rotation: Floats) -> Effect:
    """The effect on a body that is turned by a rotation (3, 3); the same object if it turns with the body."""
    proposed = effect.proposed
    acting = proposed.make(proposed.mean)
    if acting.with_body_turned(rotation) is acting:
        return effect
    other = replace(proposed, make=lambda c: proposed.make(c).with_body_turned(rotation))
    return base.effects.of([other])[0]


def _further(base: Base, first: Effect, second: Effect, z: Floats, points: Floats) -> Floats:
    """Rows of tracked points at other places (k, 3) [m]: effect of the first, columns of the second, nuisances."""
    nuisances, effects = base.at_points(points)
    effect, other = effects.of([first.proposed, second.proposed])
    # as many columns as at the recorded points
    columns = np.column_stack([other.mean, other.columns]) if second.mean.any() else other.columns
    return np.column_stack([effect.mean + effect.columns @ z, columns, nuisances.columns])
