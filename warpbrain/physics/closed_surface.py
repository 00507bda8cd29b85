"""A surface that encloses something, as a file has it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Floats


@dataclass(frozen=True)
class ClosedSurface:
    """A closed surface of triangles."""

    file: str  # where it came from, for people
    points: Floats = field(repr=False, compare=False)  # (n, 3) [m]
    faces: NDArray[np.int32] = field(repr=False, compare=False)  # (k, 3), oriented in one way, inwards or outwards

    def __str__(self) -> str:
        return self.file

    @property
    def outward(self) -> NDArray[np.int32]:
        """The triangles, all turned if they enclose a negative volume."""
        a, b, c = (self.points[self.faces[:, i]] - self.points.mean(axis=0) for i in range(3))
        return self.faces if np.einsum("ij,ij->", a, np.cross(b, c)) > 0.0 else self.faces[:, ::-1]
