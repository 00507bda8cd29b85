"""The secant shear modulus: a strain energy seen as the neo-Hookean one of the same value.

On the incompressible uniaxial path a neo-Hookean solid has `Psi = mu I(l)`, `I(l) = (l^2 + 2/l - 3) / 2`. Dividing any
other energy by `I` leaves `mu(l)`, smooth through `l = 1`, where energies vanish and their logarithms do not exist. Its
logarithm `z` is what the hierarchical model describes: constant for a neo-Hookean solid, curved for one that stiffens.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from warpbrain.arrays import Floats
from warpbrain.gp.literature.study import OFFSET


def invariant(stretches: ArrayLike) -> Floats:
    """`I(l) = (l^2 + 2/l - 3) / 2`, in the form `(l - 1)^2 (l + 2) / (2 l)` that keeps all digits near 1."""
    l = np.asarray(stretches, dtype=np.float64)
    return 0.5 * (l - 1.0) ** 2 * (l + 2.0) / l


def equivalent_strain(stretches: ArrayLike) -> Floats:
    """`e(l) = sgn(l - 1) sqrt(2 I / 3)`, which is `l - 1` near rest; of equal size where both sides have one I1."""
    l = np.asarray(stretches, dtype=np.float64)
    return np.asarray((l - 1.0) * np.sqrt((l + 2.0) / (3.0 * l)))


def stretch_of(strains: ArrayLike) -> Floats:
    """The stretch of an equivalent strain `e`: the root of `l^3 - 3 (1 + e^2) l + 2 = 0` on the side of `e`."""
    e = np.asarray(strains, dtype=np.float64)
    # Vieta's cosine, written from rest, where its arc cosine would lose half the digits
    third = np.arctan(e * np.sqrt(3.0 + 3.0 * e**2 + e**4)) / 3.0
    return np.asarray(np.sqrt(1.0 + e**2) * (np.cos(third) + np.sqrt(3.0) * np.sin(third)))


def log_secant_modulus(stretches: ArrayLike, energies: ArrayLike) -> Floats:
    """`z = ln(Psi / I)` with moduli in Pa, at stretches other than 1."""
    return np.log(np.asarray(energies, dtype=np.float64) / invariant(stretches))


def log_energy(stretches: ArrayLike, log_modulus: ArrayLike) -> Floats:
    """`y = ln(Psi + 1e-4)`, as the paper trains on it, of `z`; any stretches > 0."""
    return np.log(invariant(stretches) * np.exp(np.asarray(log_modulus, dtype=np.float64)) + OFFSET)
