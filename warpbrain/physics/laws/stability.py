"""Is a set of parameters stable? The conditions of the supplement's Table 2, checked before a law is used.

They are read on the incompressible uniaxial path `(l, l^-1/2, l^-1/2)` of supplement eq. (2), on which the laws are
fitted and compared in the paper: no energy and no stress at rest; `dPsi/dl` negative in compression and positive in
tension; `d2Psi/dl2 > 0` throughout; energy and slope growing without bound at both ends.

They are read in three dimensions too, with the volumetric part, until the volume has doubled or halved: along uniaxial
strain `(l, 1, 1)`, where `d2Psi/dl2` is the table's `d2Psi/dl_1^2`, and along dilation `(l, l, l)`. The Hessian at rest
has `a` on its diagonal and `b` beside it, so its eigenvalues are `a - b` and `a + 2 b`: two thirds of the curvature at
rest along the first path and a third of that along dilation. If both are positive, it is positive definite.

Farther out the table cannot hold, by construction of the volumetric parts. `lam/2 (ln J)^2` is concave from `J = e` on:
along `(l, 1, 1)` one-term Ogden laws with negative exponents lose convexity at `l` = 2.1 to 2.6 if the Poisson ratio is
0.3, at 2.6 to 2.7 if it is 0.45, and nearly every law does at 2.72 if it is 0.4999. `K/2 (l^3 - 1)^2` is concave in `l`
below `J = 2/5`. For `J` from 1/2 to 2 the table holds for neo-Hookean, Mooney-Rivlin with positive coefficients (unless
`lam` is negative, see below), and one-term Ogden laws with exponents above 1 or below -2, to 50 each way, at Poisson
ratios from 0.3 to 0.4999; at smaller ones coupled Ogden laws with negative exponents soften, and are refused.

A negative `lam` is refused as well: the energy of a coupled law then falls without bound as `J -> 0`.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Bools, Floats
from warpbrain.errors import InputError, require_kind
from warpbrain.physics.laws.law import Law

#: Points on both sides of one where sixth-order differences are taken, from the left to the right.
_AROUND = np.arange(-3, 4)
#: Step of `ln l` for the slope at rest: small enough for exponents of some hundreds.
_STEP = 2e-4
_NEAR_REST = np.exp(_STEP * _AROUND[:, None] * np.ones(3))


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
        # `c = dw/dl_i` at rest [Pa]: a third of the slope along `(l, l, l)`, all three being the same
        slope, _ = derivatives(law.energy(_NEAR_REST), np.zeros(1), _STEP)
        return law.energy(stretches) + log_J * (0.5 * modulus * log_J - float(slope[0]) / 3.0)
    isochoric = stretches * np.exp(-log_J / 3.0)[..., None]
    return law.energy(isochoric) + 0.5 * modulus * np.expm1(log_J) ** 2


@dataclass(frozen=True)
class Path:
    """Principal stretches `(l^a, l^b, l^c)`, evenly spaced in `ln l` and the same distance to both sides of rest."""

    exponents: tuple[float, float, float]  # `a`, `b` and `c`
    reach: float  # largest `l`; the smallest is its inverse
    steps: int  # number of steps from rest to each end

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
        count = self.steps + 3
        return np.exp(self.step * np.arange(-count, count + 1.0)[:, None] * np.array(self.exponents))


def derivatives(energy: Floats, logs: Floats, step: float) -> tuple[Floats, Floats]:
    """`dPsi/dl` and `d2Psi/dl2` (..., n) at `ln l` (..., n) by sixth-order differences.

    Energies (..., n + 6) are at `ln l` that are a `step` apart, three more at each end than derivatives.
    """
    e = [energy[..., k : energy.shape[-1] - 6 + k] for k in range(7)]
    first = (e[6] - e[0] + 9 * (e[1] - e[5]) + 45 * (e[4] - e[2])) / (60 * step)
    second = (2 * (e[0] + e[6]) - 27 * (e[1] + e[5]) + 270 * (e[2] + e[4]) - 490 * e[3]) / (180 * step * step)
    stretch = np.exp(logs)
    return first / stretch, (second - first) / stretch**2


#: A factor of ten each way, far outside what tissue survives.
_UNIAXIAL = Path((1.0, -0.5, -0.5), reach=10.0, steps=200)
#: Twice and half the volume, by their names in a message.
_IN_SPACE = {
    " along (l, 1, 1)": Path((1.0, 0.0, 0.0), reach=2.0, steps=60),
    " along (l, l, l)": Path((1.0, 1.0, 1.0), reach=2.0 ** (1.0 / 3.0), steps=20),
}
#: Where the growth at the two ends is judged: so far out that a part of a millionth comes to light if it grows.
_ENDS = {"l -> 0": (1e-3, 1e-9), "l -> infinity": (1e3, 1e9)}
_END_STEP = 1e-2
#: `ln l` there (end, near or far, 1), and stretches around for differences (end, near or far, 7, 3).
_LOG_ENDS = np.log(list(_ENDS.values()))[..., None]
_AROUND_ENDS = np.exp((_LOG_ENDS + _END_STEP * _AROUND)[..., None] * np.array(_UNIAXIAL.exponents))


class UnstableLawError(InputError):
    """Parameters whose law softens or lacks a barrier; the message says at which stretch."""


def require_stable(law: Law, poisson: float = 0.45, formulation: str = "coupled") -> None:
    """Raise `UnstableLawError` if the law breaks a condition of the supplement's Table 2.

    Parameters
    ----------
    law : Law
    poisson : float
        Poisson ratio at rest.
    formulation : str
        One of `FORMULATIONS`.

    Raises
    ------
    UnstableLawError
        Naming the law, the stretch and the condition.
    InputError
        If the Poisson ratio is outside (-1, 0.5) or the formulation is unknown.

    Examples
    --------
    >>> from warpbrain.physics.laws import MooneyRivlin
    >>> require_stable(MooneyRivlin(300.0, 200.0))
    """
    require_kind(law, Law, "law", "a Law, such as warpbrain.NeoHookean(mu=1000)")
    volumetric = law.volumetric_modulus(poisson, formulation)
    whole = f"{law!r}, {formulation}, at the Poisson ratio {poisson:g}"
    if formulation == "coupled" and volumetric < 0.0:
        raise UnstableLawError(
            f"{whole} has lam = {volumetric:.3g} Pa: its energy falls without bound as J -> 0 (supplement Table 2); "
            "the uncoupled formulation does not"
        )
    energy = total_energy(law, _NEAR_REST ** np.array([1.0, 0.0, 0.0]), poisson, formulation)
    # by the symmetry of the energy its three slopes are the same: one along `(l, 1, 1)` stands for the gradient
    rest, slope = float(energy[3]), float(derivatives(energy, np.zeros(1), _STEP)[0][0])
    if abs(rest) > 1e-9 * law.shear_modulus or abs(slope) > 1e-6 * law.shear_modulus:
        raise UnstableLawError(f"{whole} is not at rest at l = 1: energy {rest:.3g} Pa, slope {slope:.3g} Pa")
    _require_rising_and_convex(repr(law), "", _UNIAXIAL, law.energy(_UNIAXIAL.stretches))
    _require_growth(law)
    for along, path in _IN_SPACE.items():
        _require_rising_and_convex(whole, along, path, total_energy(law, path.stretches, poisson, formulation))


def _require_rising_and_convex(subject: str, along: str, path: Path, energy: Floats) -> None:
    with np.errstate(over="ignore", invalid="ignore"):
        slope, curvature = derivatives(energy, path.logs, path.step)
    wrong = (slope * path.logs <= 0.0) & (path.logs != 0.0)

    def nearest_to_rest(where: Bools) -> float:
        return float(np.exp(min(path.logs[where], key=abs)))

    if wrong.any():
        l = nearest_to_rest(wrong)
        side, sign = ("compression", "negative") if l < 1.0 else ("tension", "positive")
        raise UnstableLawError(
            f"{subject} is unstable in {side}{along}: dPsi/dl at l = {l:.3g} is not {sign} (supplement Table 2)"
        )
    if (curvature <= 0.0).any():
        l = nearest_to_rest(curvature <= 0.0)
        raise UnstableLawError(
            f"{subject} is unstable at the stretch l = {l:.3g}{along}: d2Psi/dl2 is not positive (supplement Table 2)"
        )


def _require_growth(law: Law) -> None:
    with np.errstate(over="ignore", invalid="ignore"):
        energies = law.energy(_AROUND_ENDS)
        slopes = np.abs(derivatives(energies, _LOG_ENDS, _END_STEP)[0][..., 0])
    for end, energy, slope in zip(_ENDS, energies[..., 3], slopes, strict=True):
        for name, (near, far) in (("energy", energy), ("slope", slope)):
            # an overflow is growth; otherwise six decades must add a visible part
            if np.isfinite([near, far]).all() and far < 1.01 * near:
                raise UnstableLawError(f"{law!r}: the {name} does not grow without bound as {end} (supplement Table 2)")
