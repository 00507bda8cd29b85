"""What acts need not act at once, or all the time."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from warpbrain.errors import InputError

#: Rounding of factors that users write.
_ROUNDING = 1e-6


@dataclass(frozen=True, kw_only=True)
class Ramped:
    """Something that acts with a factor over time."""

    #: Factor over time [s], linear between the points and constant outside them; 1 if empty
    ramp: Sequence[tuple[float, float]] = field(default=())

    def __post_init__(self) -> None:
        times = [t for t, _ in self.ramp]
        if not np.all(np.isfinite(np.asarray(self.ramp, dtype=float))):
            raise InputError(f"ramp = {list(self.ramp)}: times and factors must be finite")
        if any(b <= a for a, b in itertools.pairwise(times)):
            raise InputError(f"ramp = {list(self.ramp)}: times must increase")

    def factor(self, time: float = math.inf) -> float:
        """The ramp's factor at a time [s]; by default long after everything."""
        if not self.ramp:
            return 1.0
        times, factors = zip(*self.ramp, strict=True)
        return float(np.interp(time, times, factors))


def take_turns(ramped: Sequence[Ramped]) -> bool:
    """Whether they are together no more than one of them in full: their factors add up to 1, or the largest of all."""
    # a sum of absolute values of linear functions is largest at an end of a piece
    times = sorted({time for one in ramped for time, _ in one.ramp})
    sizes = np.array([[abs(one.factor(time)) for one in ramped] for time in (*times, math.inf)])
    return bool(sizes.sum(axis=1).max() <= max(1.0, float(sizes.max())) * (1.0 + _ROUNDING))
