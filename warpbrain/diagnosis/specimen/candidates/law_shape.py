"""Another shape of the law than the case's: stiffening with strain, and a share of the second invariant.

    stress x exp(k (I1 - 3))                        (Demiray 1972)
    mu ((1 - c) neo-Hookean + c of `I2`)            (Mooney 1940)

Small ones are nuisances of every hypothesis, see `warpbrain.diagnosis.specimen.nuisances`; these are large.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.case import Case
from warpbrain.diagnosis.specimen.acting import Acting, Assumption, Unit
from warpbrain.diagnosis.specimen.invariants import first_invariant, second_invariant_excess
from warpbrain.diagnosis.specimen.protocol import Protocol
from warpbrain.physics.proposal import NotTestableError

Floats = NDArray[np.float64]

STIFFENING, SECOND_INVARIANT = "stiffening", "second invariant"


def invariant_rows(protocol: Protocol) -> Floats:
    """`I1 - 3` (n,) at all rows."""
    return np.concatenate([first_invariant(test.mode, test.strain) for test in protocol.tests])


def excess_rows(protocol: Protocol, unit: Unit) -> Floats:
    """Stress (n,) of `I2` less that of `I1` [Pa], of the case's shear modulus."""
    found = np.concatenate([second_invariant_excess(test.mode, test.strain) for test in protocol.tests])
    return unit.mu * found * unit.glued


def stiffening(case: Case, protocol: Protocol) -> tuple[Assumption, ...]:
    """`k` such that the largest strain is a factor `exp(0.5)` stiffer, within a factor of 3."""
    I = invariant_rows(protocol)
    largest = float(I.max())

    def act(c: Floats, unit: Unit) -> Acting:
        return Acting(scaled=unit.base * np.expm1(np.minimum(np.exp(c[0]) * I / largest, 8.0)))

    return (
        Assumption(
            kind=STIFFENING,
            physics=True,
            sentence="Tissue stiffens with strain, in all directions alike.",
            names=("k",),
            units=("",),
            mean=np.array([np.log(0.5)]),
            sd=np.array([1.1]),
            act=act,
            values=lambda c: (float(np.exp(c[0])) / largest,),
            starts=((0.0,), (-1.5,), (1.5,)),
        ),
    )


def second_invariant(case: Case, protocol: Protocol) -> tuple[Assumption, ...]:
    """A share of any size."""
    if not any(test.mode == "axial" for test in protocol.tests if test.fitted):
        raise NotTestableError("needs an axial test: in shear both invariants are one")

    def act(c: Floats, unit: Unit) -> Acting:
        return Acting(scaled=c[0] * excess_rows(protocol, unit))

    return (
        Assumption(
            kind=SECOND_INVARIANT,
            physics=True,
            sentence="The law of the tissue depends on the second invariant.",
            names=("share",),
            units=("",),
            mean=np.array([0.0]),
            sd=np.array([2.0]),
            act=act,
            values=lambda c: (float(c[0]),),
        ),
    )
