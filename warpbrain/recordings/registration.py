"""How well what was recorded is registered to the anatomy."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import InputError


@dataclass(frozen=True)
class Registration:
    """How far a registration may be wrong: one standard deviation each, normal.

    `InputError` if one is not a positive number.
    """

    shift: float  # of each component of a shift [m]
    turn: float  # of each component of a rotation vector [rad]

    def __post_init__(self) -> None:
        for name, value in (("shift", self.shift), ("turn", self.turn)):
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f"registration: {name} = {value}: expected a positive number")

    @property
    def deviations(self) -> Floats:
        """Standard deviations of the six numbers, shape (6,)."""
        return np.repeat([self.shift, self.turn], 3)
