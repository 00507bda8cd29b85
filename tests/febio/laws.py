"""Laws of FEBio's that warpbrain does not ship, as files of device functions that it runs like its own.

Sources: FEBio Theory Manual, version 4, chapter 5. FEBio's uncoupled laws are `W(C J^(-2/3)) + U(J)`: the first part
is warpbrain's own uncoupled law with a bulk modulus of 0 (`Isochoric...`), and `U` is added here.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp

from warpbrain.kernels.invariants import cofactor
from warpbrain.physics.laws import Law, LawKey, MooneyRivlin, NeoHookean, Ogden
from warpbrain.physics.laws.device import InvariantLaw
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.term import Body, ExtraEnergy, ExtraEnergyTerm


class _WithoutVolume:
    """A law whose volumetric part is added by another term."""

    def volumetric_modulus(self, poisson: float, formulation: str) -> float:
        return 0.0


@dataclass(frozen=True)
class IsochoricMooneyRivlin(_WithoutVolume, MooneyRivlin):
    """warpbrain's uncoupled Mooney-Rivlin law without its volumetric part."""


@dataclass(frozen=True)
class IsochoricOgden(_WithoutVolume, Ogden):
    """warpbrain's uncoupled Ogden law without its volumetric part."""


@dataclass(frozen=True)
class Nothing(_WithoutVolume, NeoHookean):
    """No energy: what is there is all added by terms."""

    def parameters(self) -> tuple[float, ...]:
        return (0.0,) * len(super().parameters())


# -- Holmes-Mow: exponential in the invariants -----------------------------------------------------------------


@wp.func
def _exponent(I1: Any, I2: Any, J: Any, parameters: wp.array2d[Any], e: int):
    lam = parameters[e, 0]
    mu = parameters[e, 1]
    beta = parameters[e, 2]
    two = type(J)(2.0)
    three = type(J)(3.0)
    first = (two * mu - lam) * (I1 - three) + lam * (I2 - three)
    return beta / (lam + two * mu) * first - two * beta * wp.log(J)


@wp.func
def _holmes_mow_energy(I1: Any, I2: Any, J: Any, parameters: wp.array2d[Any], e: int):
    c = (parameters[e, 0] + type(J)(2.0) * parameters[e, 1]) / (type(J)(2.0) * parameters[e, 2])
    return type(J)(0.5) * c * (wp.exp(_exponent(I1, I2, J, parameters, e)) - type(J)(1.0))


@wp.func
def _holmes_mow_derivatives(I1: Any, I2: Any, J: Any, parameters: wp.array2d[Any], e: int):
    lam = parameters[e, 0]
    mu = parameters[e, 1]
    beta = parameters[e, 2]
    two = type(J)(2.0)
    M = lam + two * mu
    W = M / (type(J)(4.0) * beta) * wp.exp(_exponent(I1, I2, J, parameters, e))
    q1 = beta * (two * mu - lam) / M
    q2 = beta * lam / M
    qJ = -two * beta / J
    return (
        W * q1, W * q2, W * qJ,
        W * q1 * q1, W * q1 * q2, W * q1 * qJ, W * q2 * q2, W * q2 * qJ, W * (qJ * qJ + two * beta / (J * J)),
    )  # fmt: skip


_HOLMES_MOW = InvariantLaw("febio_holmes_mow", _holmes_mow_energy, _holmes_mow_derivatives, second_invariant=True)


@dataclass(frozen=True)
class HolmesMow(Law):
    """`c/2 (e^Q - 1)`, `Q = beta/(lam + 2 mu) ((2 mu - lam)(I1 - 3) + lam (I2 - 3) - (lam + 2 mu) ln J^2)`."""

    mu: float
    lam: float
    beta: float
    name: ClassVar[str] = "holmes-mow"
    keys: ClassVar[Mapping[str, LawKey]] = {"mu": LawKey(""), "lam": LawKey(""), "beta": LawKey("")}

    @property
    def shear_modulus(self) -> float:
        return self.mu

    @classmethod
    def of_shear_modulus(cls, mu: float) -> "HolmesMow":
        return cls(mu, mu, 1.0)

    def parameters(self) -> tuple[float, ...]:
        return (self.mu, self.beta)

    def volumetric_modulus(self, poisson: float, formulation: str) -> float:
        return self.lam

    def energy(self, stretches: np.ndarray) -> np.ndarray:
        """Of the compressible law."""
        squares = stretches**2
        I1, J = squares.sum(axis=-1), stretches.prod(axis=-1)
        I2 = 0.5 * (I1**2 - (squares**2).sum(axis=-1))
        M = self.lam + 2.0 * self.mu
        first = (2.0 * self.mu - self.lam) * (I1 - 3.0) + self.lam * (I2 - 3.0)
        return 0.25 * M / self.beta * np.expm1(self.beta / M * first - 2.0 * self.beta * np.log(J))

    @classmethod
    def device_law(cls, formulation: str) -> InvariantLaw:
        return _HOLMES_MOW

    def scaled_to(self, shear_modulus: float) -> "HolmesMow":
        factor = shear_modulus / self.mu
        return HolmesMow(shear_modulus, factor * self.lam, self.beta)


# -- uncoupled Holmes-Mow: an exponential of the isochoric first invariant ----------------------------------------


@wp.func
def _exponential_energy(I1: Any, I2: Any, J: Any, parameters: wp.array2d[Any], e: int):
    mu = parameters[e, 1]
    beta = parameters[e, 2]
    root = wp.cbrt(J)
    one = type(J)(1.0)
    return mu / (type(J)(2.0) * beta) * (wp.exp(beta * (I1 / (root * root) - type(J)(3.0))) - one)


@wp.func
def _exponential_derivatives(I1: Any, I2: Any, J: Any, parameters: wp.array2d[Any], e: int):
    mu = parameters[e, 1]
    beta = parameters[e, 2]
    zero = type(J)(0.0)
    root = wp.cbrt(J)
    x1 = type(J)(1.0) / (root * root)
    x = I1 * x1
    rate = type(J)(-2.0) / (type(J)(3.0) * J)
    xJ = rate * x
    # derivatives of psi by x, the isochoric invariant
    first = type(J)(0.5) * mu * wp.exp(beta * (x - type(J)(3.0)))
    second = beta * first
    d1J = second * x1 * xJ + first * rate * x1
    dJJ = second * xJ * xJ - type(J)(5.0) / (type(J)(3.0) * J) * first * xJ
    return first * x1, zero, first * xJ, second * x1 * x1, zero, d1J, zero, zero, dJJ


_EXPONENTIAL = InvariantLaw("febio_exponential", _exponential_energy, _exponential_derivatives, second_invariant=False)


@dataclass(frozen=True)
class IsochoricHolmesMow(_WithoutVolume, Law):
    """`mu/(2 beta) (exp(beta (J^(-2/3) I1 - 3)) - 1)`."""

    mu: float
    beta: float
    name: ClassVar[str] = "uncoupled holmes-mow"
    keys: ClassVar[Mapping[str, LawKey]] = {"mu": LawKey(""), "beta": LawKey("")}

    @property
    def shear_modulus(self) -> float:
        return self.mu

    @classmethod
    def of_shear_modulus(cls, mu: float) -> "IsochoricHolmesMow":
        return cls(mu, 1.0)

    def parameters(self) -> tuple[float, ...]:
        return (self.mu, self.beta)

    def energy(self, stretches: np.ndarray) -> np.ndarray:
        first = np.sum(stretches**2, axis=-1) - 3.0
        return 0.5 * self.mu / self.beta * np.expm1(self.beta * first)

    @classmethod
    def device_law(cls, formulation: str) -> InvariantLaw:
        return _EXPONENTIAL

    def scaled_to(self, shear_modulus: float) -> "IsochoricHolmesMow":
        return IsochoricHolmesMow(shear_modulus, self.beta)


# -- Arruda-Boyce: chains of N links, five terms of their series ---------------------------------------------------
# FEBio's program multiplies the coefficients of the derivative (1/2, 1/10, 11/350, ...) by the powers once more: its
# energy has them where that of Arruda and Boyce (1993) has 1/2, 1/20, 11/1050, ...


@wp.func
def _chains(x: Any, parameters: wp.array2d[Any], e: int):
    """Energy by the isochoric first invariant, and its two derivatives."""
    mu = parameters[e, 1]
    n = type(x)(1.0) / parameters[e, 2]
    three = type(x)(3.0)
    c2 = n / type(x)(10.0)
    c3 = type(x)(11.0) / type(x)(350.0) * n * n
    c4 = type(x)(19.0) / type(x)(1750.0) * n * n * n
    c5 = type(x)(519.0) / type(x)(134750.0) * n * n * n * n
    two = type(x)(2.0)
    four = type(x)(4.0)
    five = type(x)(5.0)
    half = type(x)(0.5)
    value = x * (half + x * (c2 + x * (c3 + x * (c4 + x * c5))))
    rest = three * (half + three * (c2 + three * (c3 + three * (c4 + three * c5))))
    first = half + x * (two * c2 + x * (three * c3 + x * (four * c4 + x * five * c5)))
    second = two * c2 + x * (two * three * c3 + x * (three * four * c4 + x * four * five * c5))
    return mu * (value - rest), mu * first, mu * second


@wp.func
def _chains_energy(I1: Any, I2: Any, J: Any, parameters: wp.array2d[Any], e: int):
    root = wp.cbrt(J)
    value, _first, _second = _chains(I1 / (root * root), parameters, e)
    return value


@wp.func
def _chains_derivatives(I1: Any, I2: Any, J: Any, parameters: wp.array2d[Any], e: int):
    zero = type(J)(0.0)
    root = wp.cbrt(J)
    x1 = type(J)(1.0) / (root * root)
    x = I1 * x1
    rate = type(J)(-2.0) / (type(J)(3.0) * J)
    xJ = rate * x
    _value, first, second = _chains(x, parameters, e)
    d1J = second * x1 * xJ + first * rate * x1
    dJJ = second * xJ * xJ - type(J)(5.0) / (type(J)(3.0) * J) * first * xJ
    return first * x1, zero, first * xJ, second * x1 * x1, zero, d1J, zero, zero, dJJ


_CHAINS = InvariantLaw("febio_chains", _chains_energy, _chains_derivatives, second_invariant=False)


@dataclass(frozen=True)
class IsochoricArrudaBoyce(_WithoutVolume, Law):
    """`mu (1/2 (x - 3) + (x^2 - 9)/(10 N) + 11 (x^3 - 27)/(350 N^2) + ...)`, `x = J^(-2/3) I1`."""

    mu: float
    links: float
    name: ClassVar[str] = "arruda-boyce"
    keys: ClassVar[Mapping[str, LawKey]] = {"mu": LawKey(""), "links": LawKey("")}

    def _terms(self) -> list[float]:
        factors = (1 / 2, 1 / 10, 11 / 350, 19 / 1750, 519 / 134750)
        return [self.mu * factor / self.links**i for i, factor in enumerate(factors)]

    @property
    def shear_modulus(self) -> float:
        return 2.0 * sum((i + 1) * c * 3.0**i for i, c in enumerate(self._terms()))

    @classmethod
    def of_shear_modulus(cls, mu: float) -> "IsochoricArrudaBoyce":
        return cls(1.0, 26.5).scaled_to(mu)

    def parameters(self) -> tuple[float, ...]:
        return (self.mu, self.links)

    def energy(self, stretches: np.ndarray) -> np.ndarray:
        x = np.sum(stretches**2, axis=-1)
        return sum(c * (x ** (i + 1) - 3.0 ** (i + 1)) for i, c in enumerate(self._terms()))

    @classmethod
    def device_law(cls, formulation: str) -> InvariantLaw:
        return _CHAINS

    def scaled_to(self, shear_modulus: float) -> "IsochoricArrudaBoyce":
        return IsochoricArrudaBoyce(self.mu * shear_modulus / self.shear_modulus, self.links)


# -- porous neo-Hookean: pores cannot close ------------------------------------------------------------------------


@wp.func
def _porous_energy(I1: Any, I2: Any, J: Any, parameters: wp.array2d[Any], e: int):
    mu = parameters[e, 1]
    solid = parameters[e, 2]
    pores = (J - solid) / (type(J)(1.0) - solid)
    root = wp.cbrt(pores / J)
    return mu * (type(J)(0.5) * (root * root * I1 - type(J)(3.0)) - wp.log(pores))


@wp.func
def _porous_derivatives(I1: Any, I2: Any, J: Any, parameters: wp.array2d[Any], e: int):
    mu = parameters[e, 1]
    solid = parameters[e, 2]
    zero = type(J)(0.0)
    half = type(J)(0.5)
    left = J - solid
    root = wp.cbrt(left / ((type(J)(1.0) - solid) * J))
    R = root * root
    # of ln R by J
    q = type(J)(2.0) / type(J)(3.0) * solid / (J * left)
    dq = -q * (J + left) / (J * left)
    d1 = half * mu * R
    dJ = d1 * I1 * q - mu / left
    return d1, zero, dJ, zero, zero, d1 * q, zero, zero, d1 * I1 * (q * q + dq) + mu / (left * left)


_POROUS = InvariantLaw("febio_porous", _porous_energy, _porous_derivatives, second_invariant=False)


@dataclass(frozen=True)
class PorousNeoHookean(_WithoutVolume, Law):
    """`mu/2 (R I1 - 3) - mu ln p`, `p = (J - solid)/(1 - solid)`, `R = (p/J)^(2/3)`."""

    mu: float
    solid: float
    name: ClassVar[str] = "porous neo-hookean"
    keys: ClassVar[Mapping[str, LawKey]] = {"mu": LawKey(""), "solid": LawKey("")}

    @property
    def shear_modulus(self) -> float:
        return self.mu

    @classmethod
    def of_shear_modulus(cls, mu: float) -> "PorousNeoHookean":
        return cls(mu, 0.1)

    def parameters(self) -> tuple[float, ...]:
        return (self.mu, self.solid)

    def energy(self, stretches: np.ndarray) -> np.ndarray:
        """Of the compressible law."""
        J = stretches.prod(axis=-1)
        pores = (J - self.solid) / (1.0 - self.solid)
        return self.mu * (0.5 * ((pores / J) ** (2.0 / 3.0) * np.sum(stretches**2, axis=-1) - 3.0) - np.log(pores))

    @classmethod
    def device_law(cls, formulation: str) -> InvariantLaw:
        return _POROUS

    def scaled_to(self, shear_modulus: float) -> "PorousNeoHookean":
        return PorousNeoHookean(shear_modulus, self.solid)


# -- energies that are added ---------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Added(Mechanism):
    """An energy of `F` and of a row of numbers, the same in all elements."""

    code: ExtraEnergy
    row: tuple[float, ...]
    kind: ClassVar[str] = "febio-added"
    sentence: ClassVar[str] = "An energy of FEBio's is added."
    example: ClassVar[str] = ""

    def bind(self, body: Body) -> ExtraEnergyTerm:
        elements = np.arange(len(body.mesh.tetrahedra))
        return ExtraEnergyTerm(body, self.code, elements, np.tile(self.row, (len(elements), 1)), self.factor)


#: `U(J)` by FEBio's names of its `pressure_model`.
VOLUMETRIC = {"default": 0.0, "NIKE3D": 1.0, "Abaqus": 2.0}


@wp.func
def _volumetric_derivatives(J: Any, data: wp.array2d[Any], e: int):
    K = data[e, 0]
    one = type(J)(1.0)
    first = K * wp.log(J) / J
    second = K * (one - wp.log(J)) / (J * J)
    if data[e, 1] == one:
        first = type(J)(0.5) * K * (J - one / J)
        second = type(J)(0.5) * K * (one + one / (J * J))
    if data[e, 1] == type(J)(2.0):
        first = K * (J - one)
        second = K
    return first, second


@wp.func
def _volumetric_energy(F: Any, data: wp.array2d[Any], e: int):
    K = data[e, 0]
    J = wp.determinant(F)
    one = type(J)(1.0)
    half = type(J)(0.5)
    energy = half * K * wp.log(J) * wp.log(J)
    if data[e, 1] == one:
        energy = half * K * (half * (J * J - one) - wp.log(J))
    if data[e, 1] == type(J)(2.0):
        energy = half * K * (J - one) * (J - one)
    return energy


@wp.func
def _volumetric_stress(F: Any, data: wp.array2d[Any], e: int):
    first, _second = _volumetric_derivatives(wp.determinant(F), data, e)
    return first * cofactor(F)


@wp.func
def _volumetric_moduli(F: Any, g: Any, h: Any, data: wp.array2d[Any], e: int):
    J = wp.determinant(F)
    first, second = _volumetric_derivatives(J, data, e)
    cof = cofactor(F)
    c = cof * g
    ch = cof * h
    return (second + first / J) * wp.outer(c, ch) - first / J * wp.outer(ch, c)


_VOLUMETRIC = ExtraEnergy("febio_volumetric", _volumetric_energy, _volumetric_stress, _volumetric_moduli)


def volumetric(bulk_modulus: float, pressure_model: str = "default") -> Added:
    """`U(J)`: `K/2 (ln J)^2`, or another that FEBio has."""
    return Added(code=_VOLUMETRIC, row=(bulk_modulus, VOLUMETRIC[pressure_model]))


# Fibres in isochoric strain: psi(I4), I4 = J^(-2/3) |F a|^2. Rows: a, then the number of the law and its parameters.


@wp.func
def _fibre_derivatives(I4: Any, data: wp.array2d[Any], e: int):
    """First and second derivative of psi by I4."""
    zero = type(I4)(0.0)
    one = type(I4)(1.0)
    half = type(I4)(0.5)
    stretch = wp.sqrt(I4)
    # stretch dpsi/dstretch, and its derivative by the stretch
    g = zero
    dg = zero
    if data[e, 3] == one and one < stretch:
        # exponential toe: c3 (exp(c4 (stretch - 1)) - 1), then the line c5 stretch + c6 from lam_max on
        lam_max = data[e, 7]
        if stretch < lam_max:
            grown = data[e, 4] * wp.exp(data[e, 5] * (stretch - one))
            g = grown - data[e, 4]
            dg = data[e, 5] * grown
        else:
            c6 = data[e, 4] * (wp.exp(data[e, 5] * (lam_max - one)) - one) - data[e, 6] * lam_max
            g = data[e, 6] * stretch + c6
            dg = data[e, 6]
    if data[e, 3] == type(I4)(2.0) and one < stretch:
        # power: xi (stretch - 1)^beta
        xi = data[e, 4]
        beta = data[e, 5]
        tension = xi * beta * wp.pow(stretch - one, beta - one)
        g = stretch * tension
        dg = tension + stretch * xi * beta * (beta - one) * wp.pow(stretch - one, beta - type(I4)(2.0))
    first = half * g / I4
    return first, half * half * dg / (stretch * I4) - first / I4


@wp.func
def _fibre(F: Any, data: wp.array2d[Any], e: int):
    a = wp.vector(data[e, 0], data[e, 1], data[e, 2])
    root = wp.cbrt(wp.determinant(F))
    return F * a / root, a / root


@wp.func
def _fibre_energy(F: Any, data: wp.array2d[Any], e: int):
    n, _a = _fibre(F, data, e)
    I4 = wp.dot(n, n)
    zero = type(I4)(0.0)
    one = type(I4)(1.0)
    stretch = wp.sqrt(I4)
    psi = zero
    if data[e, 3] == type(I4)(2.0) and one < stretch:
        psi = data[e, 4] * wp.pow(stretch - one, data[e, 5])
    if data[e, 3] == one and one < stretch:
        # the integral of g(s)/s, by Simpson's rule of 64 parts: only a line search looks at it
        step = (stretch - one) / type(I4)(64.0)
        for k in range(32):
            s = one + step * type(I4)(float(2 * k))
            f0, _d0 = _fibre_derivatives(s * s, data, e)
            s1 = s + step
            f1, _d1 = _fibre_derivatives(s1 * s1, data, e)
            s2 = s1 + step
            f2, _d2 = _fibre_derivatives(s2 * s2, data, e)
            psi += step / type(I4)(3.0) * type(I4)(2.0) * (f0 * s + type(I4)(4.0) * f1 * s1 + f2 * s2)
    return psi


@wp.func
def _fibre_stress(F: Any, data: wp.array2d[Any], e: int):
    n, a = _fibre(F, data, e)
    I4 = wp.dot(n, n)
    first, _second = _fibre_derivatives(I4, data, e)
    two = type(I4)(2.0)
    return two * first * (wp.outer(n, a) - I4 / (type(I4)(3.0) * wp.determinant(F)) * cofactor(F))


@wp.func
def _fibre_moduli(F: Any, g: Any, h: Any, data: wp.array2d[Any], e: int):
    n, a = _fibre(F, data, e)
    I4 = wp.dot(n, n)
    first, second = _fibre_derivatives(I4, data, e)
    two = type(I4)(2.0)
    third = type(I4)(1.0) / type(I4)(3.0)
    J = wp.determinant(F)
    cof = cofactor(F) / J
    c = cof * g
    ch = cof * h
    # dI4/dF . g and . h
    Hg = two * (wp.dot(a, g) * n - third * I4 * c)
    Hh = two * (wp.dot(a, h) * n - third * I4 * ch)
    K = second * wp.outer(Hg, Hh)
    # the second derivative of I4
    K += first * two * (
        -two * third * wp.outer(wp.dot(a, g) * n, ch)
        - third * wp.outer(c, Hh)
        + third * I4 * wp.outer(ch, c)
    )  # fmt: skip
    isotropic = first * two * wp.dot(a, g) * wp.dot(a, h)
    K[0, 0] += isotropic
    K[1, 1] += isotropic
    K[2, 2] += isotropic
    return K


_FIBRE = ExtraEnergy("febio_fibre", _fibre_energy, _fibre_stress, _fibre_moduli)


def fibre(direction: np.ndarray, number: int, *parameters: float) -> Added:
    """Fibres along a direction: 1 a toe and a line `c3, c4, c5, lam_max`, 2 a power `xi, beta`."""
    a = np.asarray(direction, dtype=float)
    padded = (*parameters, 0.0, 0.0, 0.0, 0.0)[:4]
    return Added(code=_FIBRE, row=(*(a / np.linalg.norm(a)), float(number), *padded))


def is_volumetric(mechanism: Mechanism) -> bool:
    """Whether an energy is a `U(J)`."""
    return isinstance(mechanism, Added) and mechanism.code is _VOLUMETRIC


def volumetric_derivatives(mechanism: Added, J: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`U'` and `U''` of one, in NumPy."""
    K, model = mechanism.row
    if model == VOLUMETRIC["default"]:
        return K * np.log(J) / J, K * (1.0 - np.log(J)) / J**2
    if model == VOLUMETRIC["NIKE3D"]:
        return 0.5 * K * (J - 1.0 / J), 0.5 * K * (1.0 + 1.0 / J**2)
    return K * (J - 1.0), K * np.ones_like(J)
