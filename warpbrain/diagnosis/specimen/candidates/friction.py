"""Ends that are not what the case says: lubricated ones that stick, glued ones that slip."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.case import Case
from warpbrain.diagnosis.specimen.acting import Acting, Assumption, Unit
from warpbrain.diagnosis.specimen.protocol import Protocol
from warpbrain.physics.proposal import NotTestableError

Floats = NDArray[np.float64]

KIND = "end friction"


def assumptions(case: Case, protocol: Protocol) -> tuple[Assumption, ...]:
    """A share of the way from one kind of ends to the other, of axial tests."""
    assert case.specimen is not None
    if not any(test.mode == "axial" for test in protocol.tests if test.fitted):
        raise NotTestableError("needs an axial test")
    glued = case.specimen.grips == "glued"
    axial = protocol.mask([k for k, test in enumerate(protocol.tests) if test.mode == "axial"])

    def act(c: Floats, unit: Unit) -> Acting:
        share = float(np.clip(c[0], 0.0, 1.0))
        sticks = 1.0 - share if glued else share
        whole = unit.glued if glued else np.ones(len(protocol))
        return Acting(factor=np.where(axial, (1.0 + sticks * (unit.sticking() - 1.0)) / whole, 1.0))

    return (
        Assumption(
            kind=KIND,
            physics=False,
            sentence="The ends of the specimen slip." if glued else "The ends of the specimen stick to the platens.",
            names=("share",),
            units=("",),
            mean=np.array([0.3]),
            sd=np.array([0.3]),
            act=act,
            values=lambda c: (float(np.clip(c[0], 0.0, 1.0)),),
        ),
    )
