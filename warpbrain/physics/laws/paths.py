"""Lines through the space of principal stretches, and the slope and curvature of an energy along them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Points beyond each end of a line that the differences take.
_BEYOND = 3


@dataclass(frozen=True)
class Path:
    """Principal stretches `(l^a, l^b, l^c)`, evenly spaced in `ln l` and the same distance to both sides of rest.

    Parameters
    ----------
    exponents : tuple of float
        `a`, `b` and `c`.
    reach : float
        Largest `l`; the smallest is its inverse.
    steps : int
        Number of steps from rest to each end.
    """

    exponents: tuple[float, float, float]
    reach: float
    steps: int

    @property
    def step(self) -> float:
        """Distance in `ln l`."""
        return float(np.log(self.reach)) / self.steps

    @cached_property
    def logs(self) -> Floats:
        """`ln l`, shape (2 steps + 1,); the one in the middle is 0."""
        return self.step * np.arange(-self.steps, self.steps + 1.0)

    @cached_property
    def stretches(self) -> Floats:
        """Where the energy is asked for, shape (2 steps + 7, 3): three points beyond each end."""
        count = self.steps + _BEYOND
        return np.exp(self.step * np.arange(-count, count + 1.0)[:, None] * np.array(self.exponents))

    def derivatives(self, energy: Floats) -> tuple[Floats, Floats]:
        """`dPsi/dl` and `d2Psi/dl2` at `logs` of an energy given at `stretches`."""
        return derivatives(energy, self.logs, self.step)


def derivatives(energy: Floats, logs: Floats, step: float) -> tuple[Floats, Floats]:
    """`dPsi/dl` and `d2Psi/dl2` by sixth-order differences in `ln l`.

    Parameters
    ----------
    energy : (..., n + 6) array
        Energies at evenly spaced `ln l`, three more at each end than derivatives.
    logs : (..., n) array
        `ln l` of the derivatives.
    step : float
        Spacing of `ln l`.
    """
    e = [energy[..., k : energy.shape[-1] - 6 + k] for k in range(7)]
    first = (e[6] - e[0] + 9 * (e[1] - e[5]) + 45 * (e[4] - e[2])) / (60 * step)
    second = (2 * (e[0] + e[6]) - 27 * (e[1] + e[5]) + 270 * (e[2] + e[4]) - 490 * e[3]) / (180 * step * step)
    stretch = np.exp(logs)
    return first / stretch, (second - first) / stretch**2
