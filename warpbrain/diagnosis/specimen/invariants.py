"""Strain of incompressible homogeneous states."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def first_invariant(mode: str, strain: Floats) -> Floats:
    """`I1 - 3` at stretches or shears (of torsion: at the rim)."""
    return strain**2 + 2.0 / strain - 3.0 if mode == "axial" else strain**2


def second_invariant_excess(mode: str, strain: Floats) -> Floats:
    """Nominal stress of `I2` less that of `I1`, at one shear modulus: `(1 - l^-3) - (l - l^-2)`, and none in shear."""
    return 1.0 - strain**-3 - strain + strain**-2 if mode == "axial" else np.zeros_like(strain)
