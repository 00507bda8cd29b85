"""Specimens that are far less alike than pieces of one tissue are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.case import Case
from warpbrain.diagnosis.specimen.acting import Acting, Assumption, Unit
from warpbrain.diagnosis.specimen.protocol import Protocol
from warpbrain.physics.proposal import NotTestableError

Floats = NDArray[np.float64]

KIND = "unlike specimens"
#: Standard deviation of the logarithm of their stiffness.
_SIZE = 0.7


def specimen_rows(protocol: Protocol) -> Floats:
    """Which rows (n, specimens) are of which specimen, 0 or 1."""
    of = np.concatenate([np.full(len(test.strain), protocol.specimens.index(test.specimen)) for test in protocol.tests])
    return (of[:, None] == np.arange(len(protocol.specimens))).astype(float)


def assumptions(case: Case, protocol: Protocol) -> tuple[Assumption, ...]:
    """A factor of the stress of each."""
    if len(protocol.specimens) < 2:
        raise NotTestableError("needs tests of several specimens ([[recording]] specimen)")
    member = specimen_rows(protocol)

    def act(c: Floats, unit: Unit) -> Acting:
        return Acting(factor=np.exp(member @ c))

    count = len(protocol.specimens)
    return (
        Assumption(
            kind=KIND,
            physics=False,
            sentence="The specimens are not of one stiffness.",
            names=tuple(f"ln stiffness of {name or 'the unnamed'}" for name in protocol.specimens),
            units=("",) * count,
            mean=np.zeros(count),
            sd=np.full(count, _SIZE),
            act=act,
            values=lambda c: tuple(float(x) for x in c),
        ),
    )
