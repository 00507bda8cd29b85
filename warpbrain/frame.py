"""The edge of the program: lengths and axes of files become metres in RAS here, and turn back here, nowhere else."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from warpbrain.arrays import Floats
from warpbrain.errors import InputError

#: Metres of one unit of length.
METRES = {"m": 1.0, "mm": 1e-3}
#: Pascals of one unit of stress.
PASCALS = {"Pa": 1.0, "kPa": 1e3}
#: Signs that turn a file's axes into RAS (x right, y anterior, z superior); LPS has x left and y posterior.
AXES = {"RAS": (1.0, 1.0, 1.0), "LPS": (-1.0, -1.0, 1.0)}


@dataclass(frozen=True)
class Frame:
    """Unit and axes of the numbers in a file."""

    unit: str = "mm"  # of `METRES`
    axes: str = "RAS"  # of `AXES`

    def __post_init__(self) -> None:
        for name, value, known in (("units", self.unit, METRES), ("axes", self.axes, AXES)):
            if value not in known:
                raise InputError(f"{name}: found '{value}', expected one of {', '.join(known)}")

    @property
    def metres(self) -> float:
        """Metres of one unit."""
        return METRES[self.unit]

    @property
    def signs(self) -> Floats:
        """Signs (3,) that turn the axes into RAS, and back."""
        return np.array(AXES[self.axes])

    def lengths(self, values: ArrayLike) -> Floats:
        """Positions or displacements (..., 3) of the file, in metres and RAS."""
        return self.metres * self.directions(values)

    def directions(self, values: ArrayLike) -> Floats:
        """Vectors (..., 3) that are no lengths (forces, normals, axes), in RAS."""
        return self.signs * np.asarray(values, dtype=np.float64)

    def file_lengths(self, values: ArrayLike) -> Floats:
        """Positions or displacements (..., 3) [m, RAS] as the file has them."""
        return self.directions(values) / self.metres
