"""A surface that encloses something, as a file has it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class ClosedSurface:
    """A closed surface of triangles.

    Parameters
    ----------
    file : str
        Where it came from, for people.
    points : (n, 3) array
        [m]
    faces : (k, 3) int array
        Oriented in one way, inwards or outwards.
    """

    file: str
    points: NDArray[np.float64] = field(repr=False, compare=False)
    faces: NDArray[np.int32] = field(repr=False, compare=False)

    def __str__(self) -> str:
        return self.file

    @property
    def outward(self) -> NDArray[np.int32]:
        """The triangles, all turned if they enclose a negative volume."""
        a, b, c = (self.points[self.faces[:, i]] - self.points.mean(axis=0) for i in range(3))
        return self.faces if np.einsum("ij,ij->", a, np.cross(b, c)) > 0.0 else self.faces[:, ::-1]
