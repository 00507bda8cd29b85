"""Is a set of parameters stable? The conditions of the supplement's Table 2, checked before a law is used.

They are read on the incompressible uniaxial path `(l, l^-1/2, l^-1/2)` of supplement eq. (2), on which the laws are
fitted and compared in the paper: at rest no energy and no stress; `dPsi/dl` negative in compression and positive in
tension; `d2Psi/dl2 > 0` throughout; energy and slope growing without bound at both ends. At rest the volumetric part
adds `mu0 > 0` and `-1 < nu < 1/2`, which the laws check themselves.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.errors import InputError
from warpbrain.physics.laws.law import Law

Floats = NDArray[np.float64]

#: Stretches at which slope and curvature are looked at: a factor of ten each way, far outside what tissue survives.
_STRETCHES = np.geomspace(0.1, 10.0, 401)
#: Decades over which the growth at the two ends is judged.
_ENDS = {"l -> 0": (1e-3, 1e-4), "l -> infinity": (1e3, 1e4)}


class UnstableLawError(InputError):
    """Parameters whose law softens or lacks a barrier; the message says at which stretch."""


def require_stable(law: Law, poisson: float = 0.45, formulation: str = "coupled") -> None:
    """Raise `UnstableLawError` if the law breaks a condition of the supplement's Table 2.

    Examples
    --------
    >>> from warpbrain.physics.laws import MooneyRivlin
    >>> require_stable(MooneyRivlin(300.0, 200.0))
    """
    volumetric = law.volumetric_modulus(poisson, formulation)
    if formulation == "coupled" and volumetric < 0.0:
        raise UnstableLawError(
            f"{_describe(law)}, coupled, at the Poisson ratio {poisson:g} has lam = {volumetric:.3g} Pa: its energy "
            "falls without bound as J -> 0 (supplement Table 2); the uncoupled formulation does not"
        )
    logs = np.log(_STRETCHES)
    slope, curvature = _derivatives(law, logs)
    scale = law.shear_modulus
    rest_energy = float(_energy(law, np.zeros(1))[0])
    rest_slope = float(_derivatives(law, np.zeros(1))[0][0])
    if abs(rest_energy) > 1e-9 * scale or abs(rest_slope) > 1e-6 * scale:
        raise UnstableLawError(
            f"{_describe(law)} is not at rest at l = 1: energy {rest_energy:.3g} Pa, slope {rest_slope:.3g} Pa"
        )
    wrong = (slope * logs <= 0.0) & (np.abs(logs) > 1e-9)
    if wrong.any():
        l = _nearest_to_rest(wrong)
        side, sign = ("compression", "negative") if l < 1.0 else ("tension", "positive")
        raise UnstableLawError(
            f"{_describe(law)} is unstable in {side}: dPsi/dl at l = {l:.3g} is not {sign} (supplement Table 2)"
        )
    if (curvature <= 0.0).any():
        l = _nearest_to_rest(curvature <= 0.0)
        raise UnstableLawError(
            f"{_describe(law)} is unstable at the stretch l = {l:.3g}: d2Psi/dl2 is not positive (supplement Table 2)"
        )
    for end, (near, far) in _ENDS.items():
        ends = np.log(np.array([near, far]))
        with np.errstate(over="ignore", invalid="ignore"):
            energy, (end_slope, _) = _energy(law, ends), _derivatives(law, ends)
            # an overflow is growth; otherwise a decade must add a visible part
            bounded = [
                name
                for name, v in (("energy", energy), ("slope", np.abs(end_slope)))
                if np.isfinite(v).all() and v[1] < 1.01 * v[0]
            ]
        if bounded:
            raise UnstableLawError(
                f"{_describe(law)}: the {bounded[0]} does not grow without bound as {end} (supplement Table 2)"
            )


def _energy(law: Law, logs: Floats) -> Floats:
    path = np.stack([logs, -0.5 * logs, -0.5 * logs], axis=-1)
    return law.energy(np.exp(path))


def _derivatives(law: Law, logs: Floats) -> tuple[Floats, Floats]:
    """`dPsi/dl` and `d2Psi/dl2` along the path, by sixth-order differences in `ln l`."""
    h = 1e-2
    with np.errstate(over="ignore", invalid="ignore"):
        e = [_energy(law, logs + k * h) for k in range(-3, 4)]
        first = (-e[0] + 9 * e[1] - 45 * e[2] + 45 * e[4] - 9 * e[5] + e[6]) / (60 * h)
        second = (2 * e[0] - 27 * e[1] + 270 * e[2] - 490 * e[3] + 270 * e[4] - 27 * e[5] + 2 * e[6]) / (180 * h * h)
        stretch = np.exp(logs)
        return first / stretch, (second - first) / stretch**2


def _nearest_to_rest(where: NDArray[np.bool_]) -> float:
    found = _STRETCHES[where]
    return float(found[np.argmin(np.abs(np.log(found)))])


def _describe(law: Law) -> str:
    return repr(law)
