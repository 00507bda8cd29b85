"""Tissue that is softer where it was deformed before: below the largest strain so far, or cycle by cycle.

stress x (1 - D (1 - I/I_max))        I = I1 - 3, I_max the largest so far (the idea of Mullins 1948)
stress x (1 - D (1 - exp(-(s/3)^2)))  s, the way so far over the largest strain: a cycle is 4
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.case import Case
from warpbrain.diagnosis.specimen.acting import Acting, Assumption, Unit
from warpbrain.diagnosis.specimen.invariants import first_invariant
from warpbrain.diagnosis.specimen.protocol import Protocol
from warpbrain.physics.proposal import NotTestableError

Floats = NDArray[np.float64]

KIND = "softening"
_SENTENCE = "Tissue is softer where it was deformed before."
#: Way over the largest strain after which tissue was deformed before.
_BACK = 1.2


def assumptions(case: Case, protocol: Protocol) -> tuple[Assumption, ...]:
    """Both of them."""
    if not any(_way(protocol, k)[-1] > _BACK for k in range(len(protocol.chains))):
        raise NotTestableError("needs a test that comes back or is repeated")
    below, cycles = np.zeros(len(protocol)), np.zeros(len(protocol))
    for number, chain in enumerate(protocol.chains):
        rows = protocol.mask(chain.tests)
        I = first_invariant(protocol.tests[chain.tests[0]].mode, chain.strain)
        below[rows] = 1.0 - I / np.maximum(np.maximum.accumulate(I), 1e-12)
        cycles[rows] = -np.expm1(-((_way(protocol, number) / 3.0) ** 2))
    return tuple(
        _assumption(pattern, region)
        for pattern, region in ((below, "below the largest strain so far"), (cycles, "with every cycle"))
    )


def _way(protocol: Protocol, number: int) -> Floats:
    chain = protocol.chains[number]
    rest = protocol.tests[chain.tests[0]].rest
    gone = np.abs(np.diff(chain.strain, prepend=rest)).cumsum()
    return gone / max(float(np.abs(chain.strain - rest).max()), 1e-12)


def _assumption(pattern: Floats, region: str) -> Assumption:
    def act(c: Floats, unit: Unit) -> Acting:
        return Acting(factor=1.0 - np.clip(c[0], 0.0, 0.95) * pattern)

    return Assumption(
        kind=KIND,
        physics=True,
        sentence=_SENTENCE,
        names=("part",),
        units=("",),
        mean=np.array([0.3]),
        sd=np.array([0.2]),
        act=act,
        values=lambda c: (float(np.clip(c[0], 0.0, 0.95)),),
        region=region,
    )
