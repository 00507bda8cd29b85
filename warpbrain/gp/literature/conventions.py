"""The ways in which papers write the same form, and how their numbers become ours (literature.md, section 4).

The functions take a paper's parameters and return those of `warpbrain.gp.literature.energies`. Ours are the
supplement's: `sum_p mu_p/alpha_p (sum_i l_i^alpha_p - 3)` for Ogden, `C1 (I1 - 3) + C2 (I2 - 3)` for Mooney-Rivlin.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

#: Parameters by name: moduli in Pa, exponents without unit; those that come in a list are tuples.
Parameters = Mapping[str, float | tuple[float, ...]]
Numbers = tuple[float, ...]


@dataclass(frozen=True)
class Parameter:
    """One number, or one list of numbers, of a form.

    Attributes
    ----------
    name : str
    unit : str
        ``"Pa"`` or nothing.
    several : bool
        Whether it is a list with an entry for each term.
    above, below : float
        Limits, themselves not allowed.
    zero : bool
        Whether it may be 0.
    """

    name: str
    unit: str = ""
    several: bool = False
    above: float = -float("inf")
    below: float = float("inf")
    zero: bool = True


@dataclass(frozen=True)
class Convention:
    """One way to write a form.

    Attributes
    ----------
    keys : tuple of Parameter
        What a study in this convention gives.
    formula : str
    convert : callable
        From these to the parameters of the form.
    """

    keys: tuple[Parameter, ...]
    formula: str
    convert: Callable[..., Parameters]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the keys."""
        return tuple(key.name for key in self.keys)


def as_they_are(**parameters: float | Numbers) -> Parameters:
    """The paper writes it as we do."""
    return parameters


def shear_of_young(*, E: float, nu: float) -> Parameters:
    """`mu = E / (2 (1 + nu))`."""
    return {"mu": 0.5 * E / (1.0 + nu)}


def ogden_of_squares(*, mu: Numbers, alpha: Numbers) -> Parameters:
    """From `2 mu_p/alpha_p^2` (Budday, Miller and Chinzei, Abaqus, FEBio): `mu_p <- 2 mu_p/alpha_p`."""
    return {"mu": tuple(2.0 * m / a for m, a in zip(mu, alpha, strict=True)), "alpha": alpha}


def ogden_of_halves(*, C: Numbers, m: Numbers) -> Parameters:
    """From `C_p/(2 m_p)` with exponents `2 m_p` (Mihai): `mu_p = C_p`, `alpha_p = 2 m_p`."""
    return {"mu": C, "alpha": tuple(2.0 * v for v in m)}


def mooney_of_halves(*, C1: float, C2: float) -> Parameters:
    """From `C1/2 (I1 - 3) + C2/2 (I2 - 3)` (Mihai)."""
    return {"C1": 0.5 * C1, "C2": 0.5 * C2}


def mooney_of_total(*, mu: float, c: float) -> Parameters:
    """From the shear modulus and the first coefficient (Budday): `C1 = c`, `C2 = mu/2 - c`."""
    return {"C1": c, "C2": 0.5 * mu - c}


def ogden_mooney_of_halves(*, C: Numbers, m: Numbers, C1: float, C2: float) -> Parameters:
    """From `C_p/(2 m_p) (sum_i l_i^(2 m_p) - 3) + C1/2 (I1 - 3) + C2/2 (I2 - 3)` (Mihai 2017)."""
    return {**ogden_of_halves(C=C, m=m), **mooney_of_halves(C1=C1, C2=C2)}


def gent_of_inverse(*, C: float, beta: float) -> Parameters:
    """From `-C/(2 beta) ln(1 - beta (I1 - 3))` (Mihai): `mu = C`, `eta = 1/beta`."""
    return {"mu": C, "eta": 1.0 / beta}
