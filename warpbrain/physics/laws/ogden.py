"""Ogden law with N terms: `w = sum_p mu_p/alpha_p (sum_i l_i^alpha_p - 3)` (supplement eq. (2)).

    coupled    Psi = w(l) - (sum_p mu_p) ln J + lam/2 (ln J)^2
    uncoupled  Psi = w(J^(-1/3) l) + K/2 (J - 1)^2

Convention: `mu_p/alpha_p`, so `mu0 = 1/2 sum_p mu_p alpha_p`. Abaqus, FEBio and Budday write `2 mu_p/alpha_p^2`:
`Ogden.from_abaqus` converts.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp

from warpbrain.arrays import Floats
from warpbrain.errors import InputError
from warpbrain.physics.laws.device import PrincipalLaw
from warpbrain.physics.laws.law import MODULUS, Coordinate, Law, LawKey, require_finite


@wp.func
def expm1_ratio(x: Any):
    """`(exp(x) - 1) / x`, 1 at x = 0, to a few rounding errors for every x."""
    one = type(x)(1.0)
    if wp.abs(x) > type(x)(0.5):
        return (wp.exp(x) - one) / x
    # (exp(x) - 1) / x = exp(x/2) sinh(x/2) / (x/2); six terms of the sinh series are exact to 1e-17 for |x| <= 1/2
    y = type(x)(0.25) * x * x
    series = one + y / type(x)(156.0)
    series = one + y / type(x)(110.0) * series
    series = one + y / type(x)(72.0) * series
    series = one + y / type(x)(42.0) * series
    series = one + y / type(x)(20.0) * series
    series = one + y / type(x)(6.0) * series
    return wp.exp(type(x)(0.5) * x) * series


@wp.func
def power_minus_one(log_l: Any, alpha: Any):
    """`l^alpha - 1` from `ln l`, without cancellation near l = 1."""
    x = alpha * log_l
    return x * expm1_ratio(x)


@wp.func
def power_quotient(log_a: Any, log_b: Any, n: Any):
    """`(a^n - b^n) / (a - b)`, and `n b^(n-1)` where a = b.

    Written as `b^(n-1) n r(n x) / r(x)` with `x = ln(a/b)` and `r(x) = (exp(x) - 1)/x`: no difference of nearly equal
    numbers and no threshold between two formulas. An error of one rounding in `x` changes the quotient by `(n-1)/2`
    roundings.
    """
    x = log_a - log_b
    return wp.exp((n - type(n)(1.0)) * log_b) * n * expm1_ratio(n * x) / expm1_ratio(x)


#: Exponent of the one term that is the neo-Hookean law.
NEO_HOOKEAN = 2.0


@wp.func
def _logs_of(l: Any):
    return type(l)(wp.log(l[0]), wp.log(l[1]), wp.log(l[2]))


@wp.func
def _term(logs: Any, mu: Any, alpha: Any):
    """`mu/alpha (sum_i l_i^alpha - 3)` of `ln l_i`."""
    powers = power_minus_one(logs[0], alpha) + power_minus_one(logs[1], alpha) + power_minus_one(logs[2], alpha)
    return mu / alpha * powers


@wp.func
def _quotients(logs: Any, n: Any):
    """`power_quotient` of the stretches 0 and 1, 0 and 2, 1 and 2."""
    first = power_quotient(logs[0], logs[1], n)
    return type(logs)(first, power_quotient(logs[0], logs[2], n), power_quotient(logs[1], logs[2], n))


@wp.func
def _coupled_energy(l: Any, parameters: wp.array2d[Any], e: int):
    terms = (parameters.shape[1] - 1) / 2
    logs = _logs_of(l)
    log_J = logs[0] + logs[1] + logs[2]
    psi = l.dtype(0.5) * parameters[e, 0] * log_J * log_J
    for p in range(terms):
        mu = parameters[e, 1 + p]
        psi += _term(logs, mu, parameters[e, 1 + terms + p]) - mu * log_J
    return psi


@wp.func
def _coupled_derivatives(l: Any, parameters: wp.array2d[Any], e: int):
    terms = (parameters.shape[1] - 1) / 2
    lam = parameters[e, 0]
    one = l.dtype(1.0)
    logs = _logs_of(l)
    volumetric = lam * (logs[0] + logs[1] + logs[2])
    T = type(l)()
    diagonal = type(l)()
    m = type(l)()
    # T_i l_i, H_ii l_i^2 and the quotients of the powers, summed over the terms
    for p in range(terms):
        mu = parameters[e, 1 + p]
        alpha = parameters[e, 1 + terms + p]
        volumetric -= mu
        for i in range(3):
            power = mu * wp.exp(alpha * logs[i])
            T[i] += power
            diagonal[i] += (alpha - one) * power
        m += mu * _quotients(logs, alpha - one)
    inverse = type(l)(one / l[0], one / l[1], one / l[2])
    H = lam * wp.outer(inverse, inverse)
    for i in range(3):
        T[i] = (T[i] + volumetric) * inverse[i]
        H[i, i] = (diagonal[i] - volumetric + lam) * inverse[i] * inverse[i]
    m[0] -= volumetric * inverse[0] * inverse[1]
    m[1] -= volumetric * inverse[0] * inverse[2]
    m[2] -= volumetric * inverse[1] * inverse[2]
    return T, H, m


@wp.func
def _uncoupled_energy(l: Any, parameters: wp.array2d[Any], e: int):
    terms = (parameters.shape[1] - 1) / 2
    third = l.dtype(1.0) / l.dtype(3.0)
    logs = _logs_of(l)
    mean = third * (logs[0] + logs[1] + logs[2])
    isochoric = type(l)(logs[0] - mean, logs[1] - mean, logs[2] - mean)
    dilation = l[0] * l[1] * l[2] - l.dtype(1.0)
    psi = l.dtype(0.5) * parameters[e, 0] * dilation * dilation
    for p in range(terms):
        psi += _term(isochoric, parameters[e, 1 + p], parameters[e, 1 + terms + p])
    return psi


@wp.func
def _uncoupled_derivatives(l: Any, parameters: wp.array2d[Any], e: int):
    terms = (parameters.shape[1] - 1) / 2
    K = parameters[e, 0]
    one = l.dtype(1.0)
    third = l.dtype(1.0) / l.dtype(3.0)
    logs = _logs_of(l)
    mean = third * (logs[0] + logs[1] + logs[2])
    J = l[0] * l[1] * l[2]
    pressure = K * (J - one) * J
    stiffness = K * (l.dtype(2.0) * J - one) * J
    # With q_i = sum_p mu_p (l_i J^(-1/3))^alpha_p and its mean q: T_i l_i = q_i - q + K (J - 1) J
    q = type(l)()
    weighted = type(l)()
    m = type(l)()
    for p in range(terms):
        mu = parameters[e, 1 + p]
        alpha = parameters[e, 1 + terms + p]
        for i in range(3):
            power = mu * wp.exp(alpha * (logs[i] - mean))
            q[i] += power
            weighted[i] += alpha * power
        m += mu * wp.exp(-alpha * mean) * _quotients(logs, alpha - one)
    common = pressure - third * (q[0] + q[1] + q[2])
    all_weighted = third * third * (weighted[0] + weighted[1] + weighted[2])
    inverse = type(l)(one / l[0], one / l[1], one / l[2])
    T = type(l)()
    H = wp.outer(inverse, inverse)
    for i in range(3):
        T[i] = (q[i] + common) * inverse[i]
        for j in range(3):
            h = all_weighted - third * (weighted[i] + weighted[j]) + stiffness
            if i == j:
                h += weighted[i] - q[i] - common
            H[i, j] = h * inverse[i] * inverse[j]
    m[0] -= common * inverse[0] * inverse[1]
    m[1] -= common * inverse[0] * inverse[2]
    m[2] -= common * inverse[1] * inverse[2]
    return T, H, m


@dataclass(frozen=True)
class Ogden(Law):
    """Ogden law with N terms.

    Parameters
    ----------
    mu : tuple of float
        Coefficients `mu_p` [Pa], in the convention `mu_p/alpha_p`.
    alpha : tuple of float
        Exponents, none of them zero; as many as `mu`.

    Raises
    ------
    InputError
        If the lists differ in length or are empty, an exponent is zero, or `mu0` is not positive.
    """

    mu: tuple[float, ...]
    alpha: tuple[float, ...]
    name: ClassVar[str] = "ogden"
    device: ClassVar[Mapping[str, PrincipalLaw]] = {
        "coupled": PrincipalLaw("ogden_coupled", _coupled_energy, _coupled_derivatives),
        "uncoupled": PrincipalLaw("ogden_uncoupled", _uncoupled_energy, _uncoupled_derivatives),
    }
    keys: ClassVar[Mapping[str, LawKey]] = {
        "mu": LawKey("Moduli of Ogden's terms.", several=True),
        "alpha": LawKey("Exponents of Ogden's terms.", unit="", several=True),
    }
    coordinates: ClassVar[tuple[Coordinate, ...]] = (
        MODULUS,
        Coordinate("alpha", "exponent", 4.0, "tissue.declared_exponent", signed=True),
    )

    def __post_init__(self) -> None:
        object.__setattr__(self, "mu", tuple(float(v) for v in self.mu))
        object.__setattr__(self, "alpha", tuple(float(v) for v in self.alpha))
        if len(self.mu) != len(self.alpha) or not self.mu:
            raise InputError(
                f"{self.name}: {len(self.mu)} values of mu and {len(self.alpha)} of alpha: expected N of each"
            )
        require_finite(self.name, "mu", *self.mu)
        require_finite(self.name, "alpha", *self.alpha)
        if 0.0 in self.alpha:
            raise InputError(f"{self.name}: alpha = {list(self.alpha)}: an exponent of 0 has no energy")
        if self.shear_modulus <= 0.0:
            raise InputError(
                f"{self.name}: mu = {list(self.mu)} Pa, alpha = {list(self.alpha)}: the shear modulus "
                f"1/2 sum mu_p alpha_p = {self.shear_modulus:g} Pa must be positive"
            )

    @classmethod
    def from_abaqus(cls, mu: tuple[float, ...], alpha: tuple[float, ...]) -> "Ogden":
        """From the convention `2 mu_p/alpha_p^2` of Abaqus, FEBio and Budday."""
        return cls(tuple(2.0 * m / a for m, a in zip(mu, alpha, strict=True)), alpha)

    @property
    def shear_modulus(self) -> float:
        return 0.5 * sum(m * a for m, a in zip(self.mu, self.alpha, strict=True))

    @classmethod
    def of_shear_modulus(cls, mu: float, alpha: float = -4.7) -> "Ogden":
        """One term, of the exponent of brain in compression and tension unless given (Miller and Chinzei 2002)."""
        return cls((2.0 * mu / alpha,), (alpha,))

    @property
    def shape(self) -> tuple[float, ...]:
        if len(self.alpha) > 1:
            raise InputError(f"{self}: has no coordinates: expected neo-Hookean, Mooney-Rivlin or Ogden with one term")
        return self.alpha

    @classmethod
    def parameter_rows(cls, laws: Sequence[Law]) -> list[tuple[float, ...]]:
        """Laws with fewer terms than another get terms of no weight."""
        terms = max(len(law.parameters()) // 2 for law in laws)
        rows = []
        for law in laws:
            count = len(law.parameters()) // 2
            mu, alpha = law.parameters()[:count], law.parameters()[count:]
            rows.append(mu + (0.0,) * (terms - count) + alpha + (2.0,) * (terms - count))
        return rows

    def energy(self, stretches: Floats) -> Floats:
        logs = np.log(stretches)
        terms = [m / a * np.sum(np.expm1(a * logs), axis=-1) for m, a in zip(self.mu, self.alpha, strict=True)]
        return np.sum(terms, axis=0)

    def scaled_to(self, shear_modulus: float) -> "Ogden":
        factor = shear_modulus / self.shear_modulus
        return Ogden(tuple(factor * m for m in self.mu), self.alpha)
