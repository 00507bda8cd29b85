"""The forms of strain energy that a study can have, on the incompressible uniaxial path `(l, l^-1/2, l^-1/2)`.

An energy takes stretches `l` > 0 of any shape and parameters in SI, and is `Psi` [Pa = J/m3] of the same shape. On the
path (supplement eq. (2); the products keep their digits near `l = 1`)

    I1 - 3 = l^2 + 2/l - 3 = (l - 1)^2 (l + 2) / l
    I2 - 3 = 2 l + 1/l^2 - 3 = (l - 1)^2 (2 l + 1) / l^2

Papers write one form in several ways. A convention takes a paper's parameters and returns ours, which are the
supplement's: `sum_p mu_p/alpha_p (sum_i l_i^alpha_p - 3)` for Ogden, `C1 (I1 - 3) + C2 (I2 - 3)` for Mooney-Rivlin.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpbrain.arrays import Floats

#: Parameters by name: moduli in Pa, exponents without unit; those that come in a list are tuples.
Parameters = Mapping[str, float | tuple[float, ...]]
Numbers = tuple[float, ...]


@dataclass(frozen=True)
class Parameter:
    """One number of a form, or one list of numbers with an entry for each term (`several`).

    Its unit is ``"Pa"`` or nothing; it lies between `above` and `below`, and may be 0 if `zero`.
    """

    name: str
    unit: str = "Pa"
    several: bool = False
    above: float = -math.inf
    below: float = math.inf
    zero: bool = True


@dataclass(frozen=True)
class Convention:
    """One way to write a form: the parameters that a paper gives, and what makes ours of them."""

    keys: Mapping[str, Parameter]  # by name
    convert: Callable[..., Parameters]


@dataclass(frozen=True)
class Form:
    """A form of strain energy."""

    energy: Callable[..., Floats]  # `Psi(l)` [Pa]: stretches of any shape, then the parameters by name
    shear_modulus: Callable[..., float]  # `mu0` [Pa] of the parameters: `d2Psi/dl2 = 3 mu0` at `l = 1`
    #: By name; where a study names none, the one whose keys it gives, and the first if several have them.
    conventions: Mapping[str, Convention]
    of_first_invariant: bool = False  # of I1 alone: tension and compression of one I1 have one energy

    def convention_of(self, keys: Iterable[str]) -> str:
        """The convention that has most of the keys; of equals the first."""
        given = set(keys)
        return max(self.conventions, key=lambda name: len(given & self.conventions[name].keys.keys()))


def first(l: Floats) -> Floats:
    """`I1 - 3` on the path."""
    return (l - 1.0) ** 2 * (l + 2.0) / l


def second(l: Floats) -> Floats:
    """`I2 - 3` on the path."""
    return (l - 1.0) ** 2 * (2.0 * l + 1.0) / l**2


def _other(convert: Callable[..., Parameters], *keys: str | Parameter) -> Convention:
    """A paper's way; names are those of moduli."""
    parameters = [Parameter(key) if isinstance(key, str) else key for key in keys]
    return Convention({parameter.name: parameter for parameter in parameters}, convert)


def _ours(*keys: str | Parameter) -> Convention:
    """The paper writes it as we do."""
    return _other(lambda **parameters: parameters, *keys)


#: Forms by the name that a study gives.
FORMS: dict[str, Form] = {}


def _form(
    shear_modulus: Callable[..., float], of_first_invariant: bool = False, **conventions: Convention
) -> Callable[[Callable[..., Floats]], Callable[..., Floats]]:
    """The energy that follows makes a form of its name."""

    def add(energy: Callable[..., Floats]) -> Callable[..., Floats]:
        FORMS[energy.__name__.replace("_", "-")] = Form(energy, shear_modulus, conventions, of_first_invariant)
        return energy

    return add


_NU = Parameter("nu", "", above=-1.0, below=0.5)
_ALPHA, _BETA = Parameter("alpha", "", zero=False), Parameter("beta", "")
_TERMS = Parameter("mu", several=True), replace(_ALPHA, several=True)
_HALF_TERMS = Parameter("C", several=True), Parameter("m", "", several=True, zero=False)


def _ogden_modulus(*, mu: Numbers, alpha: Numbers) -> float:
    return 0.5 * sum(m * a for m, a in zip(mu, alpha, strict=True))


def _ogden_of_halves(*, C: Numbers, m: Numbers) -> Parameters:
    """From `sum_p C_p/(2 m_p) (sum_i l_i^(2 m_p) - 3)`."""
    return {"mu": C, "alpha": tuple(2.0 * v for v in m)}


def _mooney_of_halves(*, C1: float, C2: float) -> Parameters:
    """From `C1/2 (I1 - 3) + C2/2 (I2 - 3)`."""
    return {"C1": 0.5 * C1, "C2": 0.5 * C2}


#: From `sum_p 2 mu_p/alpha_p^2 (sum_i l_i^alpha_p - 3)`, as Abaqus, FEBio, Budday, Miller and Chinzei write it.
_SQUARES = _other(
    lambda *, mu, alpha: {"mu": tuple(2.0 * m / a for m, a in zip(mu, alpha, strict=True)), "alpha": alpha}, *_TERMS
)


@_form(lambda *, mu: mu, shear=_ours("mu"), young=_other(lambda *, E, nu: {"mu": 0.5 * E / (1.0 + nu)}, "E", _NU))
def linear(l: Floats, *, mu: float) -> Floats:
    """Linear elasticity on a path that keeps volume: `mu dev(e) : dev(e) = 2/3 mu (l - l^-1/2)^2`, `e_i = l_i - 1`.

    The path has no volume change, so the energy of one has no place in it: this is `linear_volumetric` without it.
    """
    return 2.0 / 3.0 * mu * (l - l**-0.5) ** 2


@_form(lambda *, E, nu: 0.5 * E / (1.0 + nu), young=_ours("E", _NU))
def linear_volumetric(l: Floats, *, E: float, nu: float) -> Floats:
    """Linear elasticity as the paper's curves have it: `mu sum e_i^2 + lam/2 (sum e_i)^2`, `e_i = l_i - 1`.

    `mu = E / (2 (1 + nu))` and `lam = E nu / ((1 + nu) (1 - 2 nu))`. The sum of the strains is not zero but
    `3/4 (l - 1)^2` to second order, which charges the path for a volume change that it does not have.
    """
    mu = 0.5 * E / (1.0 + nu)
    lam = E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
    along, across = l - 1.0, l**-0.5 - 1.0
    return mu * (along**2 + 2.0 * across**2) + 0.5 * lam * (along + 2.0 * across) ** 2


@_form(lambda *, mu: mu, True, supplement=_ours("mu"))
def neo_hookean(l: Floats, *, mu: float) -> Floats:
    """`mu/2 (I1 - 3)`."""
    return 0.5 * mu * first(l)


@_form(
    lambda *, C1, C2: 2.0 * (C1 + C2),
    supplement=_ours("C1", "C2"),
    # c (I1 - 3) + (mu/2 - c) (I2 - 3)
    budday=_other(lambda *, mu, c: {"C1": c, "C2": 0.5 * mu - c}, "mu", "c"),
    mihai=_other(_mooney_of_halves, "C1", "C2"),
)
def mooney_rivlin(l: Floats, *, C1: float, C2: float) -> Floats:
    """`C1 (I1 - 3) + C2 (I2 - 3)`."""
    return C1 * first(l) + C2 * second(l)


@_form(
    _ogden_modulus,
    supplement=_ours(*_TERMS),
    budday=_SQUARES,
    miller=_SQUARES,
    abaqus=_SQUARES,
    mihai=_other(_ogden_of_halves, *_HALF_TERMS),
)
def ogden(l: Floats, *, mu: Sequence[float], alpha: Sequence[float]) -> Floats:
    """`sum_p mu_p/alpha_p (l^alpha_p + 2 l^(-alpha_p/2) - 3)`."""
    log = np.log(l)
    terms = [m / a * (np.expm1(a * log) + 2.0 * np.expm1(-0.5 * a * log)) for m, a in zip(mu, alpha, strict=True)]
    return np.sum(terms, axis=0)


@_form(
    lambda *, mu, alpha, C1, C2: _ogden_modulus(mu=mu, alpha=alpha) + 2.0 * (C1 + C2),
    supplement=_ours(*_TERMS, "C1", "C2"),
    mihai=_other(
        lambda *, C, m, **mooney: {**_ogden_of_halves(C=C, m=m), **_mooney_of_halves(**mooney)},
        *_HALF_TERMS,
        "C1",
        "C2",
    ),
)
def ogden_mooney(l: Floats, *, mu: Sequence[float], alpha: Sequence[float], C1: float, C2: float) -> Floats:
    """Ogden and Mooney-Rivlin together (Mihai 2017)."""
    return ogden(l, mu=mu, alpha=alpha) + mooney_rivlin(l, C1=C1, C2=C2)


@_form(lambda *, C, alpha: 2.0 * C, True, mihai=_ours("C", _ALPHA))
def fung(l: Floats, *, C: float, alpha: float) -> Floats:
    """`C/(2 alpha) (alpha (I1 - 3) + exp(alpha (I1 - 3)) - 1)` (Mihai 2015)."""
    x = alpha * first(l)
    return 0.5 * C / alpha * (x + np.expm1(x))


@_form(
    lambda *, mu, eta: mu,
    True,
    budday=_ours("mu", Parameter("eta", "", above=0.0)),
    # -C/(2 beta) ln(1 - beta (I1 - 3))
    mihai=_other(lambda *, C, beta: {"mu": C, "eta": 1.0 / beta}, "C", replace(_BETA, above=0.0)),
)
def gent(l: Floats, *, mu: float, eta: float) -> Floats:
    """`-mu eta/2 ln(1 - (I1 - 3)/eta)` (Budday 2017); infinite from `I1 - 3 = eta` on."""
    x = np.minimum(first(l) / eta, 1.0)
    with np.errstate(divide="ignore"):
        return -0.5 * mu * eta * np.log1p(-x)


@_form(lambda *, mu, beta: mu, True, budday=_ours("mu", replace(_BETA, zero=False)))
def demiray(l: Floats, *, mu: float, beta: float) -> Floats:
    """`mu/(2 beta) (exp(beta (I1 - 3)) - 1)` (Budday 2017)."""
    return 0.5 * mu / beta * np.expm1(beta * first(l))


@_form(lambda *, C10, C30: 2.0 * C10, True, yeoh=_ours("C10", "C30"))
def yeoh(l: Floats, *, C10: float, C30: float) -> Floats:
    """`C10 (I1 - 3) + C30 (I1 - 3)^3` (Schiavone 2009)."""
    x = first(l)
    return C10 * x + C30 * x**3


@_form(lambda *, C10, C01, C11: 2.0 * (C10 + C01), rivlin=_ours("C10", "C01", "C11"))
def rivlin(l: Floats, *, C10: float, C01: float, C11: float) -> Floats:
    """`C10 (I1 - 3) + C01 (I2 - 3) + C11 (I1 - 3) (I2 - 3)` (Laksari 2012)."""
    x, y = first(l), second(l)
    return C10 * x + C01 * y + C11 * x * y


# C : C has four times the curvature of I2; the volume change of the path adds a little
@_form(
    lambda *, C10, C01, C11, K, alpha, nu: 2.0 * (C10 + 4.0 * C01) + K * (1.0 - 2.0 * nu) ** 2 / 3.0,
    rivlin=_ours("C10", "C01", "C11", "K", _ALPHA, _NU),
)
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
