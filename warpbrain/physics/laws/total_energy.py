"""The energy of a law with its volumetric part, in NumPy: what the device code computes, for looking at it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.physics.laws.law import Law
from warpbrain.physics.laws.paths import derivatives

Floats = NDArray[np.float64]

#: Step of `ln l` for the slope at rest: small enough for exponents of some hundreds.
_STEP = 2e-4
_NEAR_REST = np.exp(_STEP * np.arange(-3, 4)[:, None] * np.ones(3))


def total_energy(law: Law, stretches: NDArray[np.float64], poisson: float, formulation: str) -> Floats:
    """Strain energy `Psi` [Pa] of a formulation (see `warpbrain.physics.laws.law`) at principal stretches.

    Parameters
    ----------
    law : Law
    stretches : (..., 3) array
        Principal stretches, positive.
    poisson : float
        Poisson ratio at rest.
    formulation : str
        One of `FORMULATIONS`.

    Returns
    -------
    (...) array

    Raises
    ------
    InputError
        If the Poisson ratio is outside (-1, 0.5) or the formulation is unknown.

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
