"""A rigid error of registration: what was recorded may lie turned and shifted against the anatomy.

One small motion is common to all recorded positions of a case: `x -> x + t + omega x (x - c)`, with `c` their mean. It
is no property of the tissue: it is estimated along with the tissue's parameters, and integrated out of what is said of
them. It enters the residuals linearly, so of normal noise both are the same.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.errors import InputError

Floats = NDArray[np.float64]

#: Names of the six numbers.
NAMES = (*(f"shift {axis} [m]" for axis in "xyz"), *(f"turn about {axis} [rad]" for axis in "xyz"))


@dataclass(frozen=True)
class Registration:
    """How far a registration may be wrong: one standard deviation each, normal.

    Attributes
    ----------
    shift : float
        Of each component of `t` [m].
    turn : float
        Of each component of `omega` [rad].
    """

    shift: float = 0.002
    turn: float = math.radians(1.0)

    def __post_init__(self) -> None:
        for name, value in (("shift", self.shift), ("turn", self.turn)):
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f"registration: {name} = {value}: expected a positive number")

    @property
    def precision(self) -> Floats:
        """Inverse covariance of the six numbers, shape (6, 6)."""
        return np.diag(np.repeat([self.shift**-2, self.turn**-2], 3))


def rigid_columns(positions: Floats, centre: Floats) -> Floats:
    """Derivatives (n, 3, 6) of moved positions (n, 3) by shift and turn."""
    columns = np.zeros((len(positions), 3, 6))
    columns[:, :, :3] = np.eye(3)
    for axis in range(3):
        columns[:, :, 3 + axis] = np.cross(np.eye(3)[axis], positions - centre)
    return columns
