"""What to measure next: by how much it would tell the two most probable causes apart.

A cause with its effect `g` on the sensors is told from another by the expected log Bayes factor over the best imitation
that the other can make, its size free:

    D = 1/2 ( |g|^2 - |P g|^2 )        in the metric of noise and nuisances
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.result import Measurement
from warpbrain.inference import GaussianModel
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.sensors import spread_points
from warpbrain.worlds.body.weighted_set import WeightedSet

Floats = NDArray[np.float64]

#: Points of a further recording.
_POINTS = 25
#: By how much the head is turned for another one [degrees], and about which axes of the body.
_TURN = 30.0
_AXES = ("left-right", "front-back", "head-foot")


def next_measurements(
    base: Base, first: WeightedSet, second: WeightedSet, names: tuple[str, str]
) -> tuple[Measurement, ...]:
    """Measurements in the order of what they tell about two mechanisms, the first of which is taken to be the cause.

    Parameters
    ----------
    base : Base
    first, second : WeightedSet
        Sets with one and with the other.
    names : (str, str)
    """
    effects = tuple(one.effects[one.mechanisms.index(name)] for one, name in zip((first, second), names, strict=True))
    z = first.coefficients[first.mechanisms.index(names[0])][0]
    asked = _Apart(base, effects[0], effects[1], z, first.marginal.scale)
    found = [
        Measurement("nothing more", asked.now()),
        Measurement("the same points with half the noise", asked.now(0.5)),
    ]
    places = _places(base)
    further = _further(base, effects[0], effects[1], z, np.concatenate(list(places.values())))
    at = 0
    for name, where in places.items():
        rows = further[3 * at : 3 * (at + len(where))]
        at += len(where)
        found.append(Measurement(f"{len(where)} more tracked points {name}", asked.with_rows(rows)))
    known = mechanisms()
    for name, effect in zip(names, effects, strict=True):
        reading = known[name].reading
        if reading is not None:
            size = abs(z[0]) * effect.proposed.sd[0] if name == names[0] else effect.proposed.sd[0]
            told = found[0].expected_nats + 0.5 * (float(size) / reading.error) ** 2
            found.append(Measurement(reading.words, told))
    found += [Measurement(f"the same points with the head turned {words}", told) for words, told in asked.turned()]
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


class _Apart:
    """Expected log Bayes factor of one effect over the best imitation by another, in noise and nuisances."""

    def __init__(self, base: Base, first: Effect, second: Effect, z: Floats, scale: float) -> None:
        self._base, self._effects, self._z, self._scale = base, (first, second), z, scale
        self._rows = np.column_stack([first.mean + first.columns @ z, _imitation(second), base.nuisances.columns])
        self._alike = _imitation(second).shape[1]

    def now(self, noise: float = 1.0) -> float:
        """With what was recorded, its noise so many times as large."""
        factor = noise * self._base.model.noise_factor
        return self._told(GaussianModel(factor, self._rows[:, 1 + self._alike :], self._scale), self._rows)

    def with_rows(self, further: Floats) -> float:
        """With further rows (m, 1 + k + q)."""
        n, m = len(self._rows), len(further)
        factor = np.zeros((n + m, n + m))
        factor[:n, :n] = self._base.model.noise_factor
        factor[n:, n:] = self._base.typical_noise * np.eye(m)
        whole = np.concatenate([self._rows, further])
        return self._told(GaussianModel(factor, whole[:, 1 + self._alike :], self._scale), whole)

    def turned(self) -> list[tuple[str, float]]:
        """With the same points again after the head is turned, in the most telling way; none if nothing stays behind.

        Tissue is the same in both poses, each is registered for itself.
        """
        from scipy.spatial.transform import Rotation

        each = []
        for axis, words in enumerate(_AXES):
            rotation = Rotation.from_rotvec(np.radians(_TURN) * np.eye(3)[axis]).as_matrix()
            effects = [_turned(self._base, effect, rotation) for effect in self._effects]
            if all(there is here for there, here in zip(effects, self._effects, strict=True)):
                return []
            alike = _imitation(effects[1])
            nuisances = self._base.nuisances
            again = np.zeros_like(nuisances.columns)
            registration = nuisances.part("registration")
            again[:, registration] = nuisances.columns[:, registration]
            first = np.column_stack([self._rows, np.zeros_like(again)])
            second = np.column_stack([effects[0].mean + effects[0].columns @ self._z, alike, nuisances.columns, again])
            second[:, 1 + self._alike :][:, registration] = 0.0
            rows = np.concatenate([first, second])
            factor: Floats = np.kron(np.eye(2), self._base.model.noise_factor).astype(np.float64)
            told = self._told(GaussianModel(factor, rows[:, 1 + self._alike :], self._scale), rows)
            each.append((f"by {_TURN:g} degrees about its {words} axis", told))
        return [max(each, key=lambda one: one[1])]

    def _told(self, model: GaussianModel, rows: Floats) -> float:
        white = model.standardised(rows[:, : 1 + self._alike])
        g, G = white[:, 0], white[:, 1:]
        M = G.T @ G
        M += 1e-10 * max(float(np.trace(M)), 1e-300) * np.eye(len(M))
        b = G.T @ g
        return 0.5 * max(float(g @ g - b @ np.linalg.solve(M, b)), 0.0)


def _imitation(effect: Effect) -> Floats:
    return np.column_stack([effect.mean, effect.columns]) if effect.mean.any() else effect.columns


def _turned(base: Base, effect: Effect, rotation: Floats) -> Effect:
    """The effect on a body that is turned by a rotation (3, 3); itself if it turns with it."""
    proposed = effect.proposed
    acting = proposed.make(proposed.mean)
    if acting.with_body_turned(rotation) is acting:
        return effect
    other = replace(proposed, make=lambda c: proposed.make(c).with_body_turned(rotation))
    return base.effects.of([other])[0]


def _further(base: Base, first: Effect, second: Effect, z: Floats, where: Floats) -> Floats:
    """Rows of tracked points at other places (k, 3) [m]: the effect, its imitation, nuisances."""
    nuisances, effects = base.at_points(where)
    there, imitation = effects.of([first.proposed, second.proposed])
    # as many columns there as here
    alike = np.column_stack([imitation.mean, imitation.columns]) if second.mean.any() else imitation.columns
    return np.column_stack([there.mean + there.columns @ z, alike, nuisances.columns])
