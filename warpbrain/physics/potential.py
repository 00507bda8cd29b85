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
