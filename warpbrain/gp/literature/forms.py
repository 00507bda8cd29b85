"""The forms of strain energy that a study can have: their energies, shear moduli and the keys that each takes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from warpbrain.gp.literature import conventions, energies
from warpbrain.gp.literature.conventions import Convention, Numbers, Parameter, as_they_are
from warpbrain.gp.literature.energies import Floats


@dataclass(frozen=True)
class Form:
    """A form of strain energy.

    Attributes
    ----------
    name : str
    formula : str
        In our parameters, which are those of the first convention unless that says otherwise.
    energy : callable
        `Psi(l)` [Pa] on the incompressible uniaxial path: stretches of any shape, then the parameters by name.
    shear_modulus : callable
        `mu0` [Pa] of the parameters, the curvature of the energy at rest: `d2Psi/dl2 = 3 mu0` at `l = 1`.
    conventions : mapping of str to Convention
        By name; where a study names none, the one whose keys it gives, and the first if several have them.
    of_first_invariant : bool
        A function of I1 alone: whatever its parameters, tension and compression of one I1 have one energy.
    """

    name: str
    formula: str
    energy: Callable[..., Floats]
    shear_modulus: Callable[..., float]
    conventions: Mapping[str, Convention]
    of_first_invariant: bool = False

    def convention_of(self, keys: Iterable[str]) -> str:
        """The convention that has most of the keys; of equals the first."""
        given = set(keys)
        return max(self.conventions, key=lambda name: len(given & set(self.conventions[name].names)))


def _ogden_modulus(*, mu: Numbers, alpha: Numbers) -> float:
    return 0.5 * sum(m * a for m, a in zip(mu, alpha, strict=True))


def _pa(*names: str) -> tuple[Parameter, ...]:
    return tuple(Parameter(name, "Pa") for name in names)


_NU = Parameter("nu", above=-1.0, below=0.5)
_YOUNG = (*_pa("E"), _NU)
_MU_ALPHA = (Parameter("mu", "Pa", several=True), Parameter("alpha", several=True, zero=False))
_C_M = (Parameter("C", "Pa", several=True), Parameter("m", several=True, zero=False))
_SQUARES = "sum_p 2 mu_p/alpha_p^2 (sum_i l_i^alpha_p - 3)"
_OGDEN = "sum_p mu_p/alpha_p (sum_i l_i^alpha_p - 3)"
_HALVES = "sum_p C_p/(2 m_p) (sum_i l_i^(2 m_p) - 3)"
_MOONEY = "C1 (I1 - 3) + C2 (I2 - 3)"
_GENT = "-mu eta/2 ln(1 - (I1 - 3)/eta)"
_RIVLIN = "C10 (I1 - 3) + C01 (I2 - 3) + C11 (I1 - 3) (I2 - 3)"


def _one(name: str, formula: str, keys: tuple[Parameter, ...]) -> dict[str, Convention]:
    return {name: Convention(keys, formula, as_they_are)}


_ALL = (
    Form(
        "linear",
        "mu dev(e) : dev(e), e_i = l_i - 1",
        energies.linear,
        lambda *, mu: mu,
        {
            "shear": Convention(_pa("mu"), "mu, the shear modulus", as_they_are),
            "young": Convention(_YOUNG, "mu = E / (2 (1 + nu))", conventions.shear_of_young),
        },
    ),
    Form(
        "linear-volumetric",
        "mu sum_i e_i^2 + lam/2 (sum_i e_i)^2, e_i = l_i - 1",
        energies.linear_volumetric,
        lambda *, E, nu: 0.5 * E / (1.0 + nu),
        _one("young", "mu = E / (2 (1 + nu)), lam = E nu / ((1 + nu) (1 - 2 nu))", _YOUNG),
    ),
    Form(
        "neo-hookean",
        "mu/2 (I1 - 3)",
        energies.neo_hookean,
        lambda *, mu: mu,
        _one("supplement", "mu/2 (I1 - 3)", _pa("mu")),
        of_first_invariant=True,
    ),
    Form(
        "mooney-rivlin",
        _MOONEY,
        energies.mooney_rivlin,
        lambda *, C1, C2: 2.0 * (C1 + C2),
        {
            "supplement": Convention(_pa("C1", "C2"), _MOONEY, as_they_are),
            "budday": Convention(_pa("mu", "c"), "c (I1 - 3) + (mu/2 - c) (I2 - 3)", conventions.mooney_of_total),
            "mihai": Convention(_pa("C1", "C2"), "C1/2 (I1 - 3) + C2/2 (I2 - 3)", conventions.mooney_of_halves),
        },
    ),
    Form(
        "ogden",
        _OGDEN,
        energies.ogden,
        _ogden_modulus,
        {
            "supplement": Convention(_MU_ALPHA, _OGDEN, as_they_are),
            "budday": Convention(_MU_ALPHA, _SQUARES, conventions.ogden_of_squares),
            "miller": Convention(_MU_ALPHA, _SQUARES, conventions.ogden_of_squares),
            "abaqus": Convention(_MU_ALPHA, _SQUARES, conventions.ogden_of_squares),
            "mihai": Convention(_C_M, _HALVES, conventions.ogden_of_halves),
        },
    ),
    Form(
        "ogden-mooney",
        f"{_OGDEN} + {_MOONEY}",
        energies.ogden_mooney,
        lambda *, mu, alpha, C1, C2: _ogden_modulus(mu=mu, alpha=alpha) + 2.0 * (C1 + C2),
        {
            "supplement": Convention((*_MU_ALPHA, *_pa("C1", "C2")), f"{_OGDEN} + {_MOONEY}", as_they_are),
            "mihai": Convention(
                (*_C_M, *_pa("C1", "C2")),
                f"{_HALVES} + C1/2 (I1 - 3) + C2/2 (I2 - 3)",
                conventions.ogden_mooney_of_halves,
            ),
        },
    ),
    Form(
        "fung",
        "C/(2 alpha) (alpha (I1 - 3) + exp(alpha (I1 - 3)) - 1)",
        energies.fung,
        lambda *, C, alpha: 2.0 * C,
        _one(
            "mihai",
            "C/(2 alpha) (alpha (I1 - 3) + exp(alpha (I1 - 3)) - 1)",
            (*_pa("C"), Parameter("alpha", zero=False)),
        ),
        of_first_invariant=True,
    ),
    Form(
        "gent",
        _GENT,
        energies.gent,
        lambda *, mu, eta: mu,
        {
            "budday": Convention((*_pa("mu"), Parameter("eta", above=0.0)), _GENT, as_they_are),
            "mihai": Convention(
                (*_pa("C"), Parameter("beta", above=0.0)),
                "-C/(2 beta) ln(1 - beta (I1 - 3))",
                conventions.gent_of_inverse,
            ),
        },
        of_first_invariant=True,
    ),
    Form(
        "demiray",
        "mu/(2 beta) (exp(beta (I1 - 3)) - 1)",
        energies.demiray,
        lambda *, mu, beta: mu,
        _one("budday", "mu/(2 beta) (exp(beta (I1 - 3)) - 1)", (*_pa("mu"), Parameter("beta", zero=False))),
        of_first_invariant=True,
    ),
    Form(
        "yeoh",
        "C10 (I1 - 3) + C30 (I1 - 3)^3",
        energies.yeoh,
        lambda *, C10, C30: 2.0 * C10,
        _one("yeoh", "C10 (I1 - 3) + C30 (I1 - 3)^3", _pa("C10", "C30")),
        of_first_invariant=True,
    ),
    Form(
        "rivlin",
        _RIVLIN,
        energies.rivlin,
        lambda *, C10, C01, C11: 2.0 * (C10 + C01),
        _one("rivlin", _RIVLIN, _pa("C10", "C01", "C11")),
    ),
    Form(
        "rivlin-as-coded",
        "rivlin with C : C for I2, + K/alpha^2 (cosh(alpha (J - 1)) - 1), J = l^(1 - 2 nu)",
        energies.rivlin_as_coded,
        # C : C has four times the curvature of I2; the volume change of the path adds a little
        lambda *, C10, C01, C11, K, alpha, nu: 2.0 * (C10 + 4.0 * C01) + K * (1.0 - 2.0 * nu) ** 2 / 3.0,
        _one(
            "rivlin",
            "rivlin with C : C for I2, + K/alpha^2 (cosh(alpha (J - 1)) - 1)",
            (*_pa("C10", "C01", "C11", "K"), Parameter("alpha", zero=False), _NU),
        ),
    ),
)
#: Forms by the name that a study gives.
FORMS: dict[str, Form] = {form.name: form for form in _ALL}
