"""The total potential that mechanisms enter, and so what each pair of them means together.

    Pi(u) = sum_e V_e J_g c [ w (Psi(F_e) + Psi_1(F_e) + ...) + T(F_e) ] + W_1(u) + ... - c f_1 . u - ...

`F = F_e F_g` in each element: what is of the tissue is an energy of the elastic part `F_e`, on the volume `J_g V_e`
that it grew to. So tissue that nothing holds swells without stress, whatever it is made of. `w` multiplies all
moduli, `c` is the part of the tissue that is left: all that it does and weighs goes with it, a tension too, which is
no modulus. A law says `Psi`. What is beside the tissue (a wall, a membrane, a fluid, a load) is an energy of the
displacement, and of neither `F_e`, `w` nor `c`. A mechanism has one place here (`Mechanism.enters`), and the system,
which knows no mechanism by name, adds them up: forces are the slope of this sum, tangents its curvature, and in a
time step what remembers stands for the potential of the step. What a pair means follows; what would have no meaning
excludes each other (`warpbrain.physics.composition`). Quadratic elements have it at each of their points; of averaged
elements a patch around a node has the mean of `J_g^(1/3)` of its elements, and its volume times their `c w`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

#: What a mechanism can be in the total potential: a place in the formula above.
PLACES = {
    "body": "which elements there are",
    "law": "`Psi`",
    "growth": "`F_g`, `J_g`",
    "moduli": "`w`",
    "part": "`c`",
    "energy": "`Psi_1`: an energy of the tissue that goes with its moduli",
    "tension": "`T`: an energy of the tissue that goes with the part that is left",
    "beside": "`W_1`: an energy of the displacement",
    "load": "`f_1`: dead forces",
    "weight": "`c f_1`: dead forces that go with the part that is left",
}


@dataclass(frozen=True)
class Enters:
    """How a mechanism enters the total potential."""

    place: str  # one of `PLACES`
    symbol: str  # of it in the formula
    fills: str = ""  # symbol of the energy of what takes the place of tissue; empty if there is none

    def __post_init__(self) -> None:
        assert self.place in PLACES, self.place


def potential(entering: Sequence[Enters]) -> str:
    """The total potential with some mechanisms, as a formula.

    Examples
    --------
    >>> potential([Enters("moduli", "r"), Enters("energy", "Psi_fibres")])
    'sum V r [Psi(F) + Psi_fibres(F)]'
    >>> potential([Enters("growth", "g"), Enters("tension", "T")])
    'sum V (1 + g) [Psi(F_e) + T(F_e)]'
    >>> potential([Enters("moduli", "r"), Enters("tension", "T")])
    'sum V [r Psi(F) + T(F)]'
    >>> potential([Enters("load", "f"), Enters("load", "f")])
    'sum V Psi(F) - f_1 . u - f_2 . u'
    """
    symbols: dict[str, list[str]] = {place: [] for place in PLACES}
    names = [each.symbol for each in entering]
    for number, entry in enumerate(entering):
        twice = names.count(entry.symbol) > 1
        symbols[entry.place].append(f"{entry.symbol}_{number + 1}" if twice else entry.symbol)
    strain = "F_e" if symbols["growth"] else "F"
    law = f"Psi_({', '.join(symbols['law'])})" if symbols["law"] else "Psi"
    elastic = [f"{name}({strain})" for name in (law, *symbols["energy"])]
    tensions = [f"{name}({strain})" for name in symbols["tension"]]
    factors = " ".join(symbols["moduli"])
    if tensions and factors:
        elastic = [f"{factors} {_bracketed(elastic)}"]
        factors = ""
    outer = [*symbols["part"], *(f"(1 + {name})" for name in symbols["growth"]), *([factors] if factors else [])]
    over = "".join(f" without {name}" for name in symbols["body"])
    text = " ".join([f"sum{over} V", *outer, _bracketed([*elastic, *tensions])])
    filled = [each.fills for each in entering if each.fills]
    text += "".join(f" + {name}(u)" for name in (*filled, *symbols["beside"]))
    weights = [f"{' '.join([*symbols['part'], name])}" for name in symbols["weight"]]
    return text + "".join(f" - {name} . u" for name in (*symbols["load"], *weights))


def _bracketed(terms: Sequence[str]) -> str:
    return terms[0] if len(terms) == 1 else f"[{' + '.join(terms)}]"
