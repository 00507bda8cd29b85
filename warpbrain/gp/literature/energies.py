"""Strain energy `Psi(l)` [Pa = J/m3] of every published form on the incompressible uniaxial path `(l, l^-1/2, l^-1/2)`.

Functions take stretches `l` > 0 of any shape and parameters in SI, and return energies of the same shape. On the path

    I1 - 3 = l^2 + 2/l - 3 = (l - 1)^2 (l + 2) / l
    I2 - 3 = 2 l + 1/l^2 - 3 = (l - 1)^2 (2 l + 1) / l^2

(supplement eq. (2); the products keep their digits near `l = 1`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def first(l: Floats) -> Floats:
    """`I1 - 3` on the path."""
    return (l - 1.0) ** 2 * (l + 2.0) / l


def second(l: Floats) -> Floats:
    """`I2 - 3` on the path."""
    return (l - 1.0) ** 2 * (2.0 * l + 1.0) / l**2


def linear(l: Floats, *, mu: float) -> Floats:
    """Linear elasticity on a path that keeps volume: `mu dev(e) : dev(e) = 2/3 mu (l - l^-1/2)^2`, `e_i = l_i - 1`.

    The path has no volume change, so the energy of one has no place in it: this is `linear_volumetric` without it.
    """
    return 2.0 / 3.0 * mu * (l - l**-0.5) ** 2


def linear_volumetric(l: Floats, *, E: float, nu: float) -> Floats:
    """Linear elasticity as the paper's curves have it: `mu sum e_i^2 + lam/2 (sum e_i)^2`, `e_i = l_i - 1`.

    `mu = E / (2 (1 + nu))` and `lam = E nu / ((1 + nu) (1 - 2 nu))`. The sum of the strains is not zero but
    `3/4 (l - 1)^2` to second order, which charges the path for a volume change that it does not have.
    """
    mu = 0.5 * E / (1.0 + nu)
    lam = E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
    along, across = l - 1.0, l**-0.5 - 1.0
    return mu * (along**2 + 2.0 * across**2) + 0.5 * lam * (along + 2.0 * across) ** 2


def neo_hookean(l: Floats, *, mu: float) -> Floats:
    """`mu/2 (I1 - 3)`."""
    return 0.5 * mu * first(l)


def mooney_rivlin(l: Floats, *, C1: float, C2: float) -> Floats:
    """`C1 (I1 - 3) + C2 (I2 - 3)`."""
    return C1 * first(l) + C2 * second(l)


def ogden(l: Floats, *, mu: Sequence[float], alpha: Sequence[float]) -> Floats:
    """`sum_p mu_p/alpha_p (l^alpha_p + 2 l^(-alpha_p/2) - 3)`."""
    log = np.log(l)
    terms = [m / a * (np.expm1(a * log) + 2.0 * np.expm1(-0.5 * a * log)) for m, a in zip(mu, alpha, strict=True)]
    return np.sum(terms, axis=0)


def ogden_mooney(l: Floats, *, mu: Sequence[float], alpha: Sequence[float], C1: float, C2: float) -> Floats:
    """Ogden and Mooney-Rivlin together (Mihai 2017)."""
    return ogden(l, mu=mu, alpha=alpha) + mooney_rivlin(l, C1=C1, C2=C2)


def fung(l: Floats, *, C: float, alpha: float) -> Floats:
    """`C/(2 alpha) (alpha (I1 - 3) + exp(alpha (I1 - 3)) - 1)` (Mihai 2015)."""
    x = alpha * first(l)
    return 0.5 * C / alpha * (x + np.expm1(x))


def gent(l: Floats, *, mu: float, eta: float) -> Floats:
    """`-mu eta/2 ln(1 - (I1 - 3)/eta)` (Budday 2017); infinite from `I1 - 3 = eta` on."""
    x = np.minimum(first(l) / eta, 1.0)
    with np.errstate(divide="ignore"):
        return -0.5 * mu * eta * np.log1p(-x)


def demiray(l: Floats, *, mu: float, beta: float) -> Floats:
    """`mu/(2 beta) (exp(beta (I1 - 3)) - 1)` (Budday 2017)."""
    return 0.5 * mu / beta * np.expm1(beta * first(l))


def yeoh(l: Floats, *, C10: float, C30: float) -> Floats:
    """`C10 (I1 - 3) + C30 (I1 - 3)^3` (Schiavone 2009)."""
    x = first(l)
    return C10 * x + C30 * x**3


def rivlin(l: Floats, *, C10: float, C01: float, C11: float) -> Floats:
    """`C10 (I1 - 3) + C01 (I2 - 3) + C11 (I1 - 3) (I2 - 3)` (Laksari 2012)."""
    x, y = first(l), second(l)
    return C10 * x + C01 * y + C11 * x * y


def rivlin_as_coded(l: Floats, *, C10: float, C01: float, C11: float, K: float, alpha: float, nu: float) -> Floats:
    """`rivlin` with two slips of the paper's source: `C : C` for `I2`, and a volume change on a path without one.

        C10 (I1 - 3) + C01 (C:C - 3) + C11 (I1 - 3) (C:C - 3) + K/alpha^2 (cosh(alpha (J - 1)) - 1)

    with `C : C = l^4 + 2/l^2` and `J = l^(1 - 2 nu)`. That `J` and the constants are known, the shape of the last
    term is not: it is taken from the usual compressible law with these two constants. With `K` = 2.38 Pa, as the
    missing unit made it, the term is less than 1e-4 Pa on the study's range, one part in ten million at its ends.
    """
    x, y = first(l), l**4 + 2.0 * l**-2 - 3.0
    J = l ** (1.0 - 2.0 * nu)
    return C10 * x + C01 * y + C11 * x * y + K / alpha**2 * (np.cosh(alpha * (J - 1.0)) - 1.0)
