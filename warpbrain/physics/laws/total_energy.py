"""The energy of a law with its volumetric part, in NumPy, and its slope and curvature along lines of stretches.

It is what the device code computes, for looking at it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.physics.laws.law import Law

#: Points beyond each end of a line that the differences take.
_BEYOND = 3
#: Step of `ln l` for the slope at rest: small enough for exponents of some hundreds.
_STEP = 2e-4
_NEAR_REST = np.exp(_STEP * np.arange(-3, 4)[:, None] * np.ones(3))


def total_energy(law: Law, stretches: Floats, poisson: float, formulation: str) -> Floats:
    """Strain energy `Psi` (...) [Pa] of a formulation (`warpbrain.physics.laws.law`) at principal stretches (..., 3).

    `InputError` if the Poisson ratio at rest is outside (-1, 0.5) or the formulation is unknown.

    Examples
    --------
    >>> from warpbrain.physics.laws import NeoHookean
    >>> float(total_energy(NeoHookean(1000.0), np.array([2.0, 1.0, 0.5]), 0.45, "coupled"))
    1125.0
    """
    modulus = law.volumetric_modulus(poisson, formulation)
    log_J = np.log(stretches).sum(axis=-1)
    if formulation == "coupled":
        return law.energy(stretches) + log_J * (0.5 * modulus * log_J - _slope_at_rest(law))
    isochoric = stretches * np.exp(-log_J / 3.0)[..., None]
    return law.energy(isochoric) + 0.5 * modulus * np.expm1(log_J) ** 2


def _slope_at_rest(law: Law) -> float:
    """`c = dw/dl_i` at rest [Pa]: a third of the slope along `(l, l, l)`, all three being the same."""
    slope, _ = derivatives(law.energy(_NEAR_REST), np.zeros(1), _STEP)
    return float(slope[0]) / 3.0


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
