"""Derivatives by the place of a mechanism, compared with equilibria."""

from dataclasses import replace

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.places import PlaceCoordinates
from warpbrain.worlds.body.states import SolvedState

#: Of the places that are compared [standard deviations of a coordinate].
STEP = 0.02


def assert_columns_are_differences(base: Base, place: PlaceCoordinates, effect: Effect, z: Floats) -> None:
    """Within 3 % of the largest, of an effect with coefficients (k,)."""

    def state_at(p: Floats) -> SolvedState:
        acting = place.at(p).acting(effect.coefficients(z))
        return base.states.solve(replace(base.state.hypothesis, mechanisms=tuple(acting)), base.state.u)

    columns = place.columns(state_at(np.zeros(4)).linearised(), effect, z)
    for axis, column in zip(np.eye(4), columns.T, strict=True):
        up, down = (state_at(sign * STEP * axis).sensors.computed for sign in (1.0, -1.0))
        difference = (up - down) / (2.0 * STEP)
        assert np.linalg.norm(column - difference) < 0.03 * np.linalg.norm(columns, axis=0).max()
