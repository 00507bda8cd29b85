"""What a load is: the base class of the terms that act on a body by forces on its nodes."""

from __future__ import annotations

import abc
import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from warpbrain.errors import InputError
from warpbrain.mesh import TetMesh


@dataclass(frozen=True, kw_only=True)
class Load(abc.ABC):
    """A dead load: forces that do not follow the deformation.

    Parameters
    ----------
    ramp : sequence of (time, factor)
        Factor on the load over time [s], linear between the points and constant outside them; 1 if empty.
    """

    #: One sentence that says what it is.
    sentence: ClassVar[str]

    ramp: Sequence[tuple[float, float]] = field(default=())

    def __post_init__(self) -> None:
        times = [t for t, _ in self.ramp]
        if not np.all(np.isfinite(np.asarray(self.ramp, dtype=float))):
            raise InputError(f"ramp = {list(self.ramp)}: times and factors must be finite")
        if any(b <= a for a, b in itertools.pairwise(times)):
            raise InputError(f"ramp = {list(self.ramp)}: times must increase")

    @abc.abstractmethod
    def nodal_forces(self, mesh: TetMesh) -> NDArray[np.float64]:
        """Forces on the nodes at factor 1 [N], shape (n, 3)."""

    def factor(self, time: float) -> float:
        """The ramp's factor at a time [s]."""
        if not self.ramp:
            return 1.0
        times, factors = zip(*self.ramp, strict=True)
        return float(np.interp(time, times, factors))
