"""An individual brain: the template moved by a smooth, invertible, random deformation of a few millimetres."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# three octaves at most one wavelength in this length [mm]: shape, not surface relief
SHORTEST_WAVELENGTH = 90.0
WAVES = 24
# many small steps along a steady velocity field: what the exact flow would be, a diffeomorphism, to rounding
STEPS = 32


def individual_warp(seed: int, amplitude: float) -> _Warp:
    """Deformation of space drawn from a seed.

    Parameters
    ----------
    seed : int
        Same seed, same deformation.
    amplitude : float
        Root mean square displacement in space [mm].
    """
    return _Warp(seed, amplitude)


class _Warp:
    """Flow for unit time of a velocity field that is a sum of long sine waves."""

    def __init__(self, seed: int, amplitude: float) -> None:
        random = np.random.default_rng(seed)
        direction = random.normal(size=(WAVES, 3))
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        # wavelengths from the shortest to four times that
        wavelength = SHORTEST_WAVELENGTH * 4 ** random.random(WAVES)
        self._wave = direction * (2 * np.pi / wavelength)[:, None]
        self._phase = 2 * np.pi * random.random(WAVES)
        self._polarisation = random.normal(size=(WAVES, 3))
        # mean square of a unit sine is one half
        self._polarisation *= amplitude / np.sqrt((self._polarisation**2).sum() / 2)

    def __call__(self, points: Floats) -> Floats:
        """Where points (n, 3) [mm] go: (n, 3) [mm]."""
        moved = np.array(points, dtype=np.float64)
        for _ in range(STEPS):
            half = moved + self._velocity(moved) / (2 * STEPS)
            moved += self._velocity(half) / STEPS
        return moved

    def _velocity(self, points: Floats) -> Floats:
        return np.asarray(np.sin(points @ self._wave.T + self._phase) @ self._polarisation)
