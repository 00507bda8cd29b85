"""Laws of FEBio's with directions: orthotropic ones in the Green strain, Blemker's muscle, growth along a direction.

FEBio Theory Manual, version 4, sections 5.2 and 5.3; Blemker, Pinsky and Delp (2005).
"""

from functools import cache
from typing import Any

import numpy as np
import warp as wp

from febio.laws import Added
from warpbrain.kernels.invariants import cofactor
from warpbrain.physics.term import ExtraEnergy


@cache
def isochoric(code: ExtraEnergy) -> ExtraEnergy:
    """The same energy of `J^(-1/3) F` in the place of `F`."""
    energy, stress, moduli = code.energy, code.stress, code.moduli

    @wp.func
    def isochoric_energy(F: Any, data: wp.array2d[Any], e: int):
        return energy(F / wp.cbrt(wp.determinant(F)), data, e)

    @wp.func
    def isochoric_stress(F: Any, data: wp.array2d[Any], e: int):
        r = wp.cbrt(wp.determinant(F))
        Fi = F / r
        T = stress(Fi, data, e)
        return (T - wp.ddot(T, Fi) / F.dtype(3.0) * cofactor(Fi)) / r

    @wp.func
    def of_dilation(Fi: Any, g: Any, data: wp.array2d[Any], e: int):
        """`A[F] g`."""
        total = g - g
        for k in range(3):
            e_k = g - g
            e_k[k] = g.dtype(1.0)
            total += moduli(Fi, g, e_k, data, e) * (Fi * e_k)
        return total

    @wp.func
    def isochoric_moduli(F: Any, g: Any, h: Any, data: wp.array2d[Any], e: int):
        third = F.dtype(1.0) / F.dtype(3.0)
        r = wp.cbrt(wp.determinant(F))
        Fi = F / r
        # the inverse transpose: the determinant is 1
        G = cofactor(Fi)
        T = stress(Fi, data, e)
        trace = wp.ddot(T, Fi)
        c = G * h / r
        a = F.dtype(0.0)
        for k in range(3):
            e_k = g - g
            e_k[k] = g.dtype(1.0)
            a += wp.dot(Fi * e_k, of_dilation(Fi, e_k, data, e))
        t = of_dilation(Fi, h, data, e)
        P_g = (T * g - third * trace * (G * g)) / r
        inner = (t + T * h) / r - third * (a + trace) * c
        K = moduli(Fi, g, h, data, e) / r - third * wp.outer(of_dilation(Fi, g, data, e), c)
        K -= third * wp.outer(G * g, inner)
        K -= third * trace * (third * wp.outer(G * g, c) - wp.outer(G * h, G * g) / r)
        return K / r - third * wp.outer(P_g, c)

    return ExtraEnergy(f"{code.key}_isochoric", isochoric_energy, isochoric_stress, isochoric_moduli)


# Orthotropic in the Green strain: with w = sum_a mu_a a.E^2 a + 1/2 sum_ab lam_ab (a.E a)(b.E b), psi = w, or Fung's
# c/2 (exp(2 w/c) - 1). Rows: three axes, mu of each, lam_11 lam_22 lam_33 lam_12 lam_23 lam_31, c (0: linear).


@wp.func
def _lam(i: int, j: int, data: wp.array2d[Any], e: int):
    place = 12 + i
    if i != j:
        # 12, 23, 31 follow the diagonal
        place = 15
        if i + j == 3:
            place = 16
        if i + j == 2:
            place = 17
    return data[e, place]


@wp.func
def _axis(i: int, data: wp.array2d[Any], e: int):
    return wp.vector(data[e, 3 * i], data[e, 3 * i + 1], data[e, 3 * i + 2])


@wp.func
def _second_stress(E: Any, data: wp.array2d[Any], e: int):
    S = E - E
    for i in range(3):
        a = _axis(i, data, e)
        Ea = E * a
        S += data[e, 9 + i] * (wp.outer(a, Ea) + wp.outer(Ea, a))
        for j in range(3):
            b = _axis(j, data, e)
            S += _lam(i, j, data, e) * wp.dot(b, E * b) * wp.outer(a, a)
    return S


@wp.func
def _green(F: Any):
    E = wp.transpose(F) * F
    half = F.dtype(0.5)
    one = F.dtype(1.0)
    for i in range(3):
        E[i, i] = E[i, i] - one
    return half * E


@wp.func
def _fung_factor(E: Any, S: Any, data: wp.array2d[Any], e: int):
    """How much stiffer than linear, and twice the derivative of that by w."""
    factor = E.dtype(1.0)
    rate = E.dtype(0.0)
    if data[e, 18] > E.dtype(0.0):
        factor = wp.exp(wp.ddot(S, E) / data[e, 18])
        rate = E.dtype(2.0) * factor / data[e, 18]
    return factor, rate


@wp.func
def _orthotropic_energy(F: Any, data: wp.array2d[Any], e: int):
    E = _green(F)
    twice = wp.ddot(_second_stress(E, data, e), E)
    psi = F.dtype(0.5) * twice
    if data[e, 18] > F.dtype(0.0):
        psi = F.dtype(0.5) * data[e, 18] * (wp.exp(twice / data[e, 18]) - F.dtype(1.0))
    return psi


@wp.func
def _orthotropic_stress(F: Any, data: wp.array2d[Any], e: int):
    E = _green(F)
    S = _second_stress(E, data, e)
    factor, _rate = _fung_factor(E, S, data, e)
    return factor * (F * S)


@wp.func
def _orthotropic_moduli(F: Any, g: Any, h: Any, data: wp.array2d[Any], e: int):
    E = _green(F)
    S = _second_stress(E, data, e)
    factor, rate = _fung_factor(E, S, data, e)
    half = F.dtype(0.5)
    gh = wp.dot(g, h)
    one = wp.identity(n=3, dtype=F.dtype)
    M = F - F
    for i in range(3):
        a = _axis(i, data, e)
        ag = wp.dot(a, g)
        ah = wp.dot(a, h)
        M += data[e, 9 + i] * half * (
            gh * wp.outer(a, a) + ah * wp.outer(a, g) + ag * (ah * one + wp.outer(h, a))
        )  # fmt: skip
        for j in range(3):
            b = _axis(j, data, e)
            M += _lam(i, j, data, e) * ag * wp.dot(b, h) * wp.outer(a, b)
    Sg = F * (S * g)
    Sh = F * (S * h)
    return factor * (F * M * wp.transpose(F) + wp.dot(g, S * h) * one) + rate * wp.outer(Sg, Sh)


_ORTHOTROPIC = ExtraEnergy("febio_orthotropic", _orthotropic_energy, _orthotropic_stress, _orthotropic_moduli)


def orthotropic_row(
    axes: np.ndarray, E: np.ndarray, G: np.ndarray, nu: np.ndarray, c: float = 0.0
) -> tuple[float, ...]:
    """Young's moduli 1, 2, 3, shear moduli and Poisson's ratios 12, 23, 31 along the rows of `axes`; `c` is Fung's."""
    compliance = np.diag(1.0 / E)
    for k, (i, j) in enumerate(((0, 1), (1, 2), (2, 0))):
        compliance[i, j] = compliance[j, i] = -nu[k] / E[i]
    stiffness = np.linalg.inv(compliance)
    mu = np.array([G[0] + G[2] - G[1], G[0] - G[2] + G[1], -G[0] + G[2] + G[1]])
    lam = [*(np.diag(stiffness) - 2.0 * mu), stiffness[0, 1], stiffness[1, 2], stiffness[2, 0]]
    return (*np.ravel(axes), *mu, *lam, c)


def orthotropic(row: tuple[float, ...]) -> Added:
    """Linear, or Fung's compressible law."""
    return Added(code=_ORTHOTROPIC, row=row)


def isochoric_orthotropic(row: tuple[float, ...]) -> Added:
    """Fung's uncoupled law."""
    return Added(code=isochoric(_ORTHOTROPIC), row=row)


# Muscle (Blemker et al. 2005): W(I1, I4, I5) = G1 B1^2 + G2 B2^2 + fibre(I4) of the isochoric C.
# Rows: a, G1, G2, P1, P2, Lofl, lam_max, smax.


@wp.func
def _muscle_fibre(stretch: Any, data: wp.array2d[Any], e: int):
    """Passive force of the fibres over their stretch, and its derivative."""
    one = type(stretch)(1.0)
    P1 = data[e, 5]
    P2 = data[e, 6]
    Lofl = data[e, 7]
    top = data[e, 8]
    force = type(stretch)(0.0)
    slope = type(stretch)(0.0)
    if Lofl < stretch:
        if stretch < top:
            grown = P1 * wp.exp(P2 * (stretch / Lofl - one))
            force = grown - P1
            slope = P2 * grown / Lofl
        else:
            grown = P1 * wp.exp(P2 * (top / Lofl - one))
            force = grown - P1 + P2 * grown * (stretch - top) / Lofl
            slope = P2 * grown / Lofl
    return data[e, 9] * force / Lofl, data[e, 9] * slope / Lofl


@wp.func
def _muscle_state(F: Any, data: wp.array2d[Any], e: int):
    a = wp.vector(data[e, 0], data[e, 1], data[e, 2])
    n = F * a
    Ca = wp.transpose(F) * n
    return a, n, Ca


@wp.func
def _cross_fibre(w: Any):
    """`acosh(w)/sqrt(w^2 - 1)` and `(1 - w` times that`)/(w^2 - 1)`, with their limits at 1 as FEBio takes them."""
    one = type(w)(1.0)
    beta = one
    ksi = -one / type(w)(3.0)
    if w > type(w)(1.0001):
        root = wp.sqrt(w * w - one)
        beta = wp.log(w + root) / root
        ksi = (one - w * beta) / (w * w - one)
    return beta, ksi


@wp.func
def _muscle_energy(F: Any, data: wp.array2d[Any], e: int):
    _a, n, Ca = _muscle_state(F, data, e)
    I1 = wp.ddot(F, F)
    I4 = wp.dot(n, n)
    I5 = wp.dot(Ca, Ca)
    one = type(I1)(1.0)
    half = type(I1)(0.5)
    stretch = wp.sqrt(I4)
    w = wp.max(half * (I1 * I4 - I5) / stretch, one)
    B2 = wp.log(w + wp.sqrt(w * w - one))
    psi = data[e, 3] * (I5 / (I4 * I4) - one) + data[e, 4] * B2 * B2
    # the fibres' part by Simpson's rule: only a line search looks at it
    step = (stretch - one) / type(I1)(64.0)
    for k in range(32):
        s = one + step * type(I1)(float(2 * k))
        f0, _d0 = _muscle_fibre(s, data, e)
        f1, _d1 = _muscle_fibre(s + step, data, e)
        f2, _d2 = _muscle_fibre(s + type(I1)(2.0) * step, data, e)
        psi += step / type(I1)(3.0) * (f0 + type(I1)(4.0) * f1 + f2)
    return psi


@wp.func
def _muscle_first(I1: Any, I4: Any, I5: Any, data: wp.array2d[Any], e: int):
    stretch = wp.sqrt(I4)
    half = type(I1)(0.5)
    G1 = data[e, 3]
    G2 = data[e, 4]
    beta, _ksi = _cross_fibre(half * (I1 * I4 - I5) / stretch)
    force, _slope = _muscle_fibre(stretch, data, e)
    W1 = G2 * beta * stretch
    W4 = -type(I1)(2.0) * G1 * I5 / (I4 * I4 * I4) + half * G2 * beta * (I1 * I4 + I5) / (I4 * stretch)
    W4 += half * force / stretch
    W5 = G1 / (I4 * I4) - G2 * beta / stretch
    return W1, W4, W5


@wp.func
def _muscle_stress(F: Any, data: wp.array2d[Any], e: int):
    a, n, Ca = _muscle_state(F, data, e)
    W1, W4, W5 = _muscle_first(wp.ddot(F, F), wp.dot(n, n), wp.dot(Ca, Ca), data, e)
    return F.dtype(2.0) * (W1 * F + W4 * wp.outer(n, a) + W5 * (wp.outer(n, Ca) + wp.outer(F * Ca, a)))


@wp.func
def _muscle_moduli(F: Any, g: Any, h: Any, data: wp.array2d[Any], e: int):
    a, n, Ca = _muscle_state(F, data, e)
    I1 = wp.ddot(F, F)
    I4 = wp.dot(n, n)
    I5 = wp.dot(Ca, Ca)
    two = type(I1)(2.0)
    half = type(I1)(0.5)
    quarter = type(I1)(0.25)
    stretch = wp.sqrt(I4)
    G1 = data[e, 3]
    G2 = data[e, 4]
    beta, ksi = _cross_fibre(half * (I1 * I4 - I5) / stretch)
    force, slope = _muscle_fibre(stretch, data, e)
    W1, W4, W5 = _muscle_first(I1, I4, I5, data, e)
    both = (I1 * I4 + I5) / (I4 * stretch)
    W11 = half * G2 * ksi * I4
    W14 = half * G2 * beta / stretch + quarter * G2 * ksi * both * stretch
    W15 = -half * G2 * ksi
    W44 = type(I1)(6.0) * G1 * I5 / (I4 * I4 * I4 * I4) + two * G2 * ksi * quarter * quarter * both * both
    W44 += -quarter * G2 * beta * (I1 * I4 + type(I1)(3.0) * I5) / (I4 * I4 * stretch)
    W44 += quarter * (slope - force / stretch) / I4
    W45 = -two * G1 / (I4 * I4 * I4) + half * G2 * beta / (I4 * stretch) - quarter * G2 * ksi * both / stretch
    W55 = half * G2 * ksi / I4
    ag = wp.dot(a, g)
    ah = wp.dot(a, h)
    # gradients of the invariants, times g and h
    g1 = two * (F * g)
    g4 = two * ag * n
    g5 = two * (wp.dot(Ca, g) * n + ag * (F * Ca))
    h1 = two * (F * h)
    h4 = two * ah * n
    h5 = two * (wp.dot(Ca, h) * n + ah * (F * Ca))
    K = wp.outer(g1, W11 * h1 + W14 * h4 + W15 * h5)
    K += wp.outer(g4, W14 * h1 + W44 * h4 + W45 * h5)
    K += wp.outer(g5, W15 * h1 + W45 * h4 + W55 * h5)
    one = wp.identity(n=3, dtype=F.dtype)
    K += two * (W1 * wp.dot(g, h) + W4 * ag * ah + W5 * (ah * wp.dot(Ca, g) + ag * wp.dot(Ca, h))) * one
    K += two * W5 * (
        wp.outer(n, wp.dot(g, h) * n + ah * (F * g)) + ag * (wp.outer(F * h, n) + ah * (F * wp.transpose(F)))
    )  # fmt: skip
    return K


_MUSCLE = ExtraEnergy("febio_muscle", _muscle_energy, _muscle_stress, _muscle_moduli)


def muscle(direction: np.ndarray, *parameters: float) -> Added:
    """`G1, G2, P1, P2, Lofl, lam_max, smax` along a direction."""
    a = direction / np.linalg.norm(direction)
    return Added(code=isochoric(_MUSCLE), row=(*a, *parameters))


# Growth along a direction or across it: F = F_e G, and only F_e makes stress, neo-Hookean (Rodriguez et al. 1994).
# Rows: mu, lam, the inverse of G.


@wp.func
def _inverse_growth(data: wp.array2d[Any], e: int):
    return wp.matrix_from_rows(
        wp.vector(data[e, 2], data[e, 3], data[e, 4]),
        wp.vector(data[e, 5], data[e, 6], data[e, 7]),
        wp.vector(data[e, 8], data[e, 9], data[e, 10]),
    )


@wp.func
def _grown_energy(F: Any, data: wp.array2d[Any], e: int):
    R = _inverse_growth(data, e)
    Fe = F * R
    log_J = wp.log(wp.determinant(Fe))
    half = F.dtype(0.5)
    psi = half * data[e, 0] * (wp.ddot(Fe, Fe) - F.dtype(3.0)) - data[e, 0] * log_J + half * data[e, 1] * log_J * log_J
    return psi / wp.determinant(R)


@wp.func
def _grown_stress(F: Any, data: wp.array2d[Any], e: int):
    R = _inverse_growth(data, e)
    Fe = F * R
    J = wp.determinant(Fe)
    P = data[e, 0] * Fe + (data[e, 1] * wp.log(J) - data[e, 0]) / J * cofactor(Fe)
    return P * wp.transpose(R) / wp.determinant(R)


@wp.func
def _grown_moduli(F: Any, g: Any, h: Any, data: wp.array2d[Any], e: int):
    R = _inverse_growth(data, e)
    Fe = F * R
    J = wp.determinant(Fe)
    Rg = wp.transpose(R) * g
    Rh = wp.transpose(R) * h
    c = cofactor(Fe) * Rg / J
    ch = cofactor(Fe) * Rh / J
    pressure = data[e, 1] * wp.log(J) - data[e, 0]
    K = data[e, 0] * wp.dot(Rg, Rh) * wp.identity(n=3, dtype=F.dtype)
    K += data[e, 1] * wp.outer(c, ch) - pressure * wp.outer(ch, c)
    return K / wp.determinant(R)


_GROWN = ExtraEnergy("febio_grown", _grown_energy, _grown_stress, _grown_moduli)


def grown(mu: float, lam: float, G: np.ndarray) -> Added:
    """A neo-Hookean law of tissue that has grown by `G` (3, 3)."""
    return Added(code=_GROWN, row=(mu, lam, *np.ravel(np.linalg.inv(G))))
