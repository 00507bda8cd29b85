"""What these recordings can tell, and others could: detectability, confusion, and what to measure next.

In coordinates in which noise and nuisances are `N(0, I)` the length of an effect `g` is its detectability, `d = |g|`.
Another cause with columns `G` explains the part `rho^2 = |P g|^2 / |g|^2` of it, `P` the projection on `G`. A mechanism
is expected to be named if `d^2 (1 - rho^2) / 2` is the log odds that the losses require, times the temperature.

That is the expected log Bayes factor of a cause over its best approximation by another one whose size is free, and the
measure of what to record next: by how much it would discriminate between the two most probable causes.
"""

import math
from dataclasses import replace

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.diagnosis.result import Confusion
from warpbrain.inference import Cause, GaussianModel, Kind
from warpbrain.inference.beliefs import belief
from warpbrain.inference.calibration import calibration
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.words import Measurement, Smallest
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.causes import BodyCauses
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.parameters import smallest_of
from warpbrain.worlds.body.sensors import spread_points
from warpbrain.worlds.body.surfaces import free_surfaces
from warpbrain.worlds.body.weighted_set import WeightedSet

#: Points of a further recording.
_POINTS = 25
#: By how much the head is turned for another one [degrees], and about which axes of the body.
_TURN = 30.0
_AXES = ("left-right", "front-back", "head-foot")


def imitations(causes: BodyCauses, model: GaussianModel) -> Confusion:
    """Part of each mechanism, at its median detectability, that the best place of each other cause explains."""
    bases = {cause.name: _orthonormal(model, cause) for cause in causes.causes}
    rows: dict[str, dict[str, float]] = {}
    for cause in causes.causes:
        if cause.kind is not Kind.PHYSICS:
            continue
        place, _ = _median_place(causes, cause, model)
        effect = model.standardised(_pattern(cause, place))
        square = max(float(effect @ effect), 1e-300)
        rows[cause.name] = {
            other: max(float(np.sum((Q.T @ effect) ** 2)) for Q in place_bases) / square
            for other, place_bases in bases.items()
            if other != cause.name
        }
    return Confusion(rows)


def smallest(causes: BodyCauses, model: GaussianModel, confusion: Confusion) -> dict[str, Smallest]:
    """Of each mechanism, the size that is detected nearly always, and that which is expected to be named."""
    seen, losses = belief("checks.seen"), calibration().losses
    # difference of log evidence from which a name has a lower expected loss than no name
    needed = calibration().temperature * math.log(losses["false name"] / losses["cannot say"] - 1.0)
    sizes = {}
    for name, others in confusion.rows.items():
        cause = causes.named(name)
        place, length = _median_place(causes, cause, model)
        imitated = max(
            (part for other, part in others.items() if causes.named(other).kind is Kind.PHYSICS), default=0.0
        )
        named = math.sqrt(2.0 * needed / (1.0 - imitated)) if imitated < 1.0 - 1e-9 else math.inf
        sizes[name] = smallest_of(causes.effects[name][place], length, seen, max(seen, named))
    return sizes


def _pattern(cause: Cause, place: int) -> Floats:
    chosen = cause.places[place]
    return chosen.columns[:, 0] if chosen.mean is None else chosen.mean


def _median_place(causes: BodyCauses, cause: Cause, model: GaussianModel) -> tuple[int, float]:
    """The place of median detectability, and its detectability; of a size that does not change, if it has any."""
    effects = causes.effects[cause.name]
    always = [k for k, effect in enumerate(effects) if effect.proposed.over_time is None]
    numbers = always or list(range(len(effects)))
    patterns = np.column_stack([_pattern(cause, place) for place in numbers])
    lengths = np.linalg.norm(model.standardised(patterns), axis=0)
    middle = int(np.argsort(lengths)[len(lengths) // 2])
    return numbers[middle], float(lengths[middle])


def _orthonormal(model: GaussianModel, cause: Cause) -> list[Floats]:
    """Orthonormal basis (n, k) of the span of the columns of each place, standardised."""
    from scipy.linalg import qr

    ends = np.cumsum([place.columns.shape[1] for place in cause.places])[:-1]
    columns = model.standardised(np.concatenate([place.columns for place in cause.places], axis=1))
    bases = []
    for of_place in np.split(columns, ends, axis=1):
        # a field's columns may have half their number in rank, where NumPy's SVD (LAPACK's gesdd) can fail to converge
        vectors, triangle, _ = qr(of_place, mode="economic", pivoting=True)
        sizes = np.abs(np.diag(triangle))
        bases.append(vectors[:, sizes > 1e-9 * max(float(sizes.max(initial=0.0)), 1e-300)])
    return bases


def next_measurements(
    base: Base, first: WeightedSet, second: WeightedSet, names: tuple[str, str]
) -> tuple[Measurement, ...]:
    """Measurements in the order of how they discriminate between two mechanisms, the first of which is taken for true.

    `first`, `second`: sets with the first and with the second mechanism. `names` (str, str).
    """
    pairs = zip((first, second), names, strict=True)
    effects = tuple(weighted_set.effects[weighted_set.acting.index(name)] for weighted_set, name in pairs)
    z = first.coefficients[first.acting.index(names[0])][0]
    discrimination = _Discrimination(base, effects[0], effects[1], z, first.marginal.scale)
    measurements = [
        Measurement("nothing more", discrimination.as_recorded()),
        Measurement("the same points with half the noise", discrimination.as_recorded(0.5)),
    ]
    places = _places(base)
    further = discrimination.rows_at(np.concatenate(list(places.values())))
    ends = 3 * np.cumsum([len(points) for points in places.values()])[:-1]
    for (name, points), rows in zip(places.items(), np.split(further, ends), strict=True):
        measurements.append(Measurement(f"{len(points)} more tracked points {name}", discrimination.with_rows(rows)))
    registry = mechanisms()
    for name, effect in zip(names, effects, strict=True):
        reading = registry[name].reading
        if reading is not None:
            size = abs(z[0]) * effect.proposed.sd[0] if name == names[0] else effect.proposed.sd[0]
            expected_nats = measurements[0].expected_nats + 0.5 * (float(size) / reading.error) ** 2
            measurements.append(Measurement(reading.words, expected_nats))
    measurements += discrimination.turned()
    return tuple(sorted(measurements, key=lambda measurement: -measurement.expected_nats))


def _places(base: Base) -> dict[str, Floats]:
    mesh = base.at.system.model.mesh
    places = {"throughout the tissue": mesh.centres[spread_points(mesh.centres, 0.0, _POINTS)]}
    still = base.at.system.model.constrained.all(axis=1)
    words = {surface.name: surface.words for surface in free_surfaces(base.states.case)}
    for name, members in mesh.node_sets.items():
        points = mesh.points[members & ~still]
        if len(points) >= _POINTS:
            places[f"on '{words.get(name, name)}'"] = points[spread_points(points, 0.0, _POINTS)]
    return places


class _Discrimination:
    """Expected log Bayes factor of one effect over its best approximation by another.

    Rows are (n, 1 + k + q): the effect, the k columns of the other, and the q of nuisances.
    """

    def __init__(self, base: Base, first: Effect, second: Effect, z: Floats, scale: float) -> None:
        self._base, self._effects, self._z, self._scale = base, (first, second), z, scale
        self._with_mean = bool(second.mean.any())
        self._width = second.columns.shape[1] + self._with_mean
        self._rows = self._rows_of(first, second, base.nuisances.columns)

    def _rows_of(self, first: Effect, second: Effect, nuisances: Floats) -> Floats:
        mean = [second.mean] if self._with_mean else []
        return np.column_stack([first.mean + first.columns @ self._z, *mean, second.columns, nuisances])

    def as_recorded(self, noise: float = 1.0) -> float:
        """With the recorded rows, their noise so many times as large."""
        return self._expected_nats(self._rows, noise * self._base.model.noise_factor)

    def rows_at(self, points: Floats) -> Floats:
        """Rows of tracked points at other places (m, 3) [m]."""
        nuisances, effects = self._base.at_points(points)
        first, second = effects.of([effect.proposed for effect in self._effects])
        return self._rows_of(first, second, nuisances.columns)

    def with_rows(self, further: Floats) -> float:
        """With further rows."""
        noise = self._base.typical_noise * np.eye(len(further))
        return self._expected_nats(np.concatenate([self._rows, further]), self._base.model.noise_factor, noise)

    def turned(self) -> list[Measurement]:
        """With the same points again after the best turn of the head; empty if both effects turn with the body.

        Tissue is the same in both poses; each pose has its own error of registration.
        """
        from scipy.spatial.transform import Rotation

        part, columns = self._base.nuisances.part("registration"), self._base.nuisances.columns
        registration, factor = columns[:, part], self._base.model.noise_factor
        common = columns.copy()
        common[:, part] = 0.0
        measurements = []
        for axis, words in enumerate(_AXES):
            rotation = Rotation.from_rotvec(np.radians(_TURN) * np.eye(3)[axis]).as_matrix()
            effects = [_turned(self._base, effect, rotation) for effect in self._effects]
            if all(turned is effect for turned, effect in zip(effects, self._effects, strict=True)):
                return []
            first = np.column_stack([self._rows, np.zeros_like(registration)])
            second = np.column_stack([self._rows_of(effects[0], effects[1], common), registration])
            expected_nats = self._expected_nats(np.concatenate([first, second]), factor, factor)
            turn = f"{_TURN:g} degrees about its {words} axis"
            measurements.append(Measurement(f"the same points with the head turned by {turn}", expected_nats))
        return [max(measurements, key=lambda measurement: measurement.expected_nats)]

    def _expected_nats(self, rows: Floats, *noise_factors: Floats) -> float:
        """Of rows whose parts, one after the other, have independent noise with these factors."""
        from scipy.linalg import block_diag

        model = GaussianModel(block_diag(*noise_factors), rows[:, 1 + self._width :], self._scale)
        white = model.standardised(rows[:, : 1 + self._width])
        g, G = white[:, 0], white[:, 1:]
        M = G.T @ G
        M += 1e-10 * max(float(np.trace(M)), 1e-300) * np.eye(len(M))
        b = G.T @ g
        return 0.5 * max(float(g @ g - b @ np.linalg.solve(M, b)), 0.0)


def _turned(base: Base, effect: Effect, rotation: Floats) -> Effect:
    """The effect on a body that is turned by a rotation (3, 3); the same object if it turns with the body."""
    proposed = effect.proposed
    acting = proposed.make(proposed.mean)
    if acting.with_body_turned(rotation) is acting:
        return effect
    other = replace(proposed, make=lambda c: proposed.make(c).with_body_turned(rotation))
    return base.effects.of([other])[0]
