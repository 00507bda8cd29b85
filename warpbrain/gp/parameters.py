"""The 37 parameters of the coregionalised process."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.errors import InputError

Floats = NDArray[np.float64]

#: Method times anatomy of the published studies: task = 4 * method + anatomy.
TASKS = 12


@dataclass(frozen=True, eq=False)
class Parameters:
    """Length scale, coregionalisation `B = w w^T + diag(kappa)` and noise.

    Attributes
    ----------
    length_scale : float
        Of stretch.
    w, kappa, noise : (12,) array
        `kappa` and the noise variances are positive.
    """

    length_scale: float
    w: Floats
    kappa: Floats
    noise: Floats

    def __post_init__(self) -> None:
        for name in ("w", "kappa", "noise"):
            value = np.asarray(getattr(self, name), dtype=np.float64)
            if value.shape != (TASKS,) or not np.all(np.isfinite(value)):
                raise InputError(f"{name}: expected {TASKS} finite numbers, found shape {value.shape}")
            if name != "w" and np.any(value <= 0.0):
                raise InputError(f"{name}: expected positive numbers, found {value.min():g}")
            object.__setattr__(self, name, value)
        if not (np.isfinite(self.length_scale) and self.length_scale > 0.0):
            raise InputError(f"length scale: expected a positive number, found {self.length_scale}")

    @property
    def coregionalisation(self) -> Floats:
        """`B`, shape (12, 12)."""
        return np.outer(self.w, self.w) + np.diag(self.kappa)

    def to_vector(self) -> Floats:
        """Free numbers for an optimiser, (37,): `w` as it is, the others as logarithms."""
        return np.concatenate([[np.log(self.length_scale)], self.w, np.log(self.kappa), np.log(self.noise)])

    @classmethod
    def from_vector(cls, vector: Floats) -> Parameters:
        """The parameters of `to_vector`."""
        w, kappa, noise = np.split(vector[1:], 3)
        return cls(float(np.exp(vector[0])), w, np.exp(kappa), np.exp(noise))
