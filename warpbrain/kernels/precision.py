"""The two floating-point precisions that kernels are made for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from warpbrain.errors import InputError


@dataclass(frozen=True)
class Precision:
    """Warp and NumPy types of one floating-point precision."""

    name: str  # ``"double"`` or ``"single"``
    scalar: Any  # Warp's types
    vec3: Any
    mat33: Any
    numpy: np.dtype[Any]

    @property
    def epsilon(self) -> float:
        """Relative rounding error of one operation."""
        return float(np.finfo(self.numpy).eps)


DOUBLE = Precision("double", wp.float64, wp.vec3d, wp.mat33d, np.dtype(np.float64))
SINGLE = Precision("single", wp.float32, wp.vec3f, wp.mat33f, np.dtype(np.float32))
PRECISIONS = {p.name: p for p in (DOUBLE, SINGLE)}


def find_precision(name: str) -> Precision:
    """The precision of a name, ``"double"`` or ``"single"``; `InputError` otherwise."""
    if name not in PRECISIONS:
        raise InputError(f"precision '{name}': expected one of {', '.join(PRECISIONS)}")
    return PRECISIONS[name]
