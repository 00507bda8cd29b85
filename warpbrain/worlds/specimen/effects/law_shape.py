"""Another shape of the law than the case's: stiffening with strain, and a share of the second invariant.

    stress x exp(k (I1 - 3))                        (Demiray 1972)
    mu ((1 - c) neo-Hookean + c of `I2`)            (Mooney 1940)

What stiffens is all of the stress, what the tissue remembers among it. Small ones are nuisances of every hypothesis
(`warpbrain.worlds.specimen.nuisances`); these are large.
"""

from __future__ import annotations

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.inference.beliefs import belief
from warpbrain.inference.causes import Kind
from warpbrain.physics.proposal import NotTestableError
from warpbrain.worlds.specimen.actions import Action, Baseline, Effect, Variant
from warpbrain.worlds.specimen.protocol import Protocol

STIFFENING, SECOND_INVARIANT = "stiffening", "second invariant"
#: Beyond which no exponential is computed.
_MOST = 8.0


def first_invariant(mode: str, strain: Floats) -> Floats:
    """`I1 - 3` of incompressible states at stretches or shears (torsion: at the rim); confined: `J^(-2/3) I1 - 3`."""
    if mode == "confined":
        return strain ** (4.0 / 3.0) + 2.0 * strain ** (-2.0 / 3.0) - 3.0
    if mode == "biaxial":
        return 2.0 * strain**2 + strain**-4 - 3.0
    return strain**2 + 2.0 / strain - 3.0 if mode == "axial" else strain**2


def invariant_rows(protocol: Protocol) -> Floats:
    """`I1 - 3` (n,) at all rows."""
    return np.concatenate([first_invariant(test.mode, test.strain) for test in protocol.tests])


def excess_rows(rows: Baseline) -> Floats:
    """Stress (n,) of `I2` less that of `I1` [Pa] at one shear modulus; confined: of the changes of shape."""
    return rows.mu * np.concatenate([_excess(test.mode, test.strain) for test in rows.protocol.tests]) * rows.glued


def _excess(mode: str, l: Floats) -> Floats:
    """Slopes of `I2 / 2` less those of `I1 / 2`, along the machine's axis (biaxial: along one of two)."""
    if mode == "axial":
        return 1.0 - l**-3 - l + l**-2
    if mode == "biaxial":
        return l**3 - l**-3 - l + l**-5
    if mode == "confined":
        return 2.0 / 3.0 * (l ** (-1.0 / 3.0) - l ** (-7.0 / 3.0) - l ** (1.0 / 3.0) + l ** (-5.0 / 3.0))
    # in shear both invariants are one
    return np.zeros(len(l))


def stiffening(case: Case, protocol: Protocol) -> Effect:
    """A factor on the response; a negative `k` softens."""
    largest = float(invariant_rows(protocol).max())

    def act(k: float, rows: Baseline) -> Action:
        return Action(factor=np.exp(np.clip(k * invariant_rows(rows.protocol), -_MOST, _MOST)))

    variant = Variant.of_one(act, belief("specimen.largest_stiffening") / largest, False)
    sentence = "Tissue stiffens with strain more than its law says (k > 0) or less (k < 0), in all directions alike."
    return Effect(STIFFENING, Kind.PHYSICS, sentence, ("k",), ("",), (variant,))


def second_invariant(case: Case, protocol: Protocol) -> Effect:
    """A share of any size."""
    if not any(test.rest == 1.0 for test in protocol.tests if test.fitted):
        raise NotTestableError("needs an axial, confined or biaxial test: in shear both invariants are one")

    def act(share: float, rows: Baseline) -> Action:
        return Action(scaled=share * excess_rows(rows))

    variant = Variant.of_one(act, belief("specimen.largest_second_invariant"), False)
    sentence = "The law of the tissue depends on the second invariant."
    return Effect(SECOND_INVARIANT, Kind.PHYSICS, sentence, ("share",), ("",), (variant,))
