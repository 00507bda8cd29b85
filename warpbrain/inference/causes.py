"""What may have caused residuals: mechanisms, unknown fields, or what is no physics, all with the same interface."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from warpbrain.arrays import Floats


class Kind(Enum):
    """Of which kind a cause is; verdicts differ among them."""

    PHYSICS = "physics"
    UNKNOWN = "unknown"
    NOT_PHYSICS = "not physics"


@dataclass(frozen=True, eq=False)
class Place:
    """A cause at one place, level, node set or course."""

    columns: Floats  # (n, k), what a unit of size of each coefficient changes of each row
    #: (n,): expected change of each row, whatever the size, such as the weight at a level of the fluid; zero if not
    #: given.
    mean: Floats | None = None
    weight: float = 1.0  # probability among the places of its cause


@dataclass(frozen=True, eq=False)
class Cause:
    """One cause.

    Coefficients are normal with the standard deviation `s`, which is one of a few sizes: a scale mixture, by which the
    prior penalises a small cause no more than a large one.
    """

    name: str
    places: tuple[Place, ...]
    log_prior: float  # logarithm of the odds that it acts, before anything was recorded
    #: (s,): standard deviations of the coefficients, in units of the columns.
    sizes: Floats = field(default_factory=lambda: np.ones(1))
    kind: Kind = Kind.PHYSICS

    @property
    def log_weights(self) -> Floats:
        """Logarithm of the probability of each place and size, (p, s): all sizes are equally probable."""
        weights = np.array([place.weight for place in self.places])
        return np.log(weights / weights.sum())[:, None] - np.log(len(self.sizes)) + np.zeros(len(self.sizes))
