"""Cross-validation of sets of causes by blocks of rows, against random patterns in the place of mechanisms.

Blocks do not depend on any fit; each is predicted from all others by conditioning the same model. Blocks are regions.
The effect of a local cause cannot be predicted from other regions, so for that blocks are scattered points.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warpbrain.arrays import Floats, Ints
from warpbrain.inference import Cause, GaussianModel, Place
from warpbrain.inference.beliefs import belief, beliefs
from warpbrain.inference.blocks import Blocks
from warpbrain.inference.predict import Prediction, predict, predict_with
from warpbrain.recordings.agreement import root_mean_square
from warpbrain.worlds.body.sensors import Sensors, spread_points

#: Blocks, and random patterns.
_BLOCKS, _PATTERNS = 24, 100


def blocks_of(sensors: Sensors, local: bool) -> Ints:
    """Block (n,) of each row: scattered points if `local`, else regions; forces are one region."""
    if local:
        return sensors.groups % _BLOCKS
    rows = sensors.is_displacement
    blocks = np.zeros(len(sensors), dtype=np.int64)
    places = sensors.positions[rows]
    if not len(places):
        return blocks
    centres = spread_points(places, 0.0, min(_BLOCKS, len(np.unique(sensors.groups[rows]))))
    blocks[rows] = np.argmin(np.linalg.norm(places[:, None] - places[centres][None], axis=2), axis=1)
    blocks[~rows] = len(centres)
    return blocks


def distance(sensors: Sensors, errors: Floats) -> float:
    """Root mean square of the 3-D distances [m] that errors (n,) of displacements are, over all recorded points."""
    rows = sensors.is_displacement
    if not rows.any():
        return float("nan")
    _, group = np.unique(sensors.groups[rows], return_inverse=True)
    return root_mean_square(np.sqrt(np.bincount(group, weights=errors[rows] ** 2)))


class HeldOut:
    """Predicts the rows of one case.

    `local`: whether all that acts is local.
    """

    def __init__(self, sensors: Sensors, local: bool) -> None:
        self.sensors, self.blocks = sensors, blocks_of(sensors, local)

    def predict(self, model: GaussianModel, residual: Floats) -> Prediction:
        """Predict every block from the others."""
        return predict(model, residual, self.blocks)

    def error(self, prediction: Prediction) -> float:
        """Root mean square [m]."""
        return distance(self.sensors, prediction.errors)

    def improvement(
        self, prediction: Prediction, over: Prediction, random: np.random.Generator
    ) -> tuple[float, float, float]:
        """Part of another prediction's error that is removed, and its 95 % interval."""
        return prediction.improvement(over, self.sensors.is_displacement, random)

    def with_patterns(
        self,
        without: GaussianModel,
        residual: Floats,
        modes: Floats,
        freedom: int,
        tries: int,
        random: np.random.Generator,
    ) -> tuple[Prediction, ...]:
        """Predictions with random patterns in the place of a mechanism.

        A pattern is a random mixture of the modes of a smooth force with the size that fits best. The best of `tries`
        patterns is taken, as the mechanism is the best of its places.

        `without`: of all else that acts. `residual` (n,). `modes` (n, m): as large as the noise. `freedom`:
        coefficients of the mechanism.
        """
        sizes = beliefs("unknown.sizes")
        chosen = []
        for _ in range(_PATTERNS):
            mixtures = random.normal(size=(tries, modes.shape[1], freedom)) / np.sqrt(freedom)
            patterns = [modes @ mixture for mixture in mixtures]
            blocks = Blocks(without, residual, [Cause("", tuple(map(Place, patterns)), 0.0, sizes)])
            logs = blocks.log_factors()
            place, size = np.unravel_index(int(np.argmax(logs)), logs.shape)
            chosen.append(sizes[size] * patterns[int(blocks.place[place])])
        return predict_with(without, residual, self.blocks, chosen)

    def ceiling(self, model: GaussianModel, residual: Floats, fields: Sequence[Floats]) -> float:
        """Least held-out error [m] with any of some fields, (n, k) as large as the noise, of any size."""
        column_sets = [size * columns for columns in fields for size in beliefs("unknown.sizes")]
        predictions = predict_with(model, residual, self.blocks, column_sets)
        return self.error(max(predictions, key=lambda prediction: prediction.log_density))


def tries_of(places: int) -> int:
    """How many patterns a scan of so many places is worth, which are far from independent of each other."""
    return int(min(places, belief("checks.tries")))
