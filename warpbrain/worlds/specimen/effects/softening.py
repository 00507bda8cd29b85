"""Tissue that is softer where it was deformed before: below the largest strain so far, or cycle by cycle.

stress x (1 - D (1 - I/I_max))        I = I1 - 3, I_max the largest so far (the idea of Mullins 1948)
stress x (1 - D (1 - exp(-(s/w)^2)))  s, the strain path so far over the largest strain: a cycle is 4
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.inference.beliefs import belief
from warpbrain.inference.causes import Kind
from warpbrain.physics.proposal import NotTestableError
from warpbrain.worlds.specimen.actions import Action, Baseline, Effect, Variant
from warpbrain.worlds.specimen.effects.law_shape import first_invariant
from warpbrain.worlds.specimen.protocol import Chain, Protocol

#: From a chain of a protocol to a pattern at its rows (n,).
Pattern = Callable[[Protocol, Chain], Floats]

NAME = "softening"
#: Strain path over the largest strain after which tissue was deformed before.
_BACK = 1.2


def softening(case: Case, protocol: Protocol) -> Effect:
    """Both of them."""
    if not any(_strain_path(protocol, chain)[-1] > _BACK for chain in protocol.chains):
        raise NotTestableError("needs a test that comes back or is repeated")
    size = belief("specimen.largest_softening")
    variants = tuple(
        Variant.of_one(_act(pattern), size, True, region)
        for pattern, region in ((_below, "below the largest strain so far"), (_cycles, "with every cycle"))
    )
    return Effect(NAME, Kind.PHYSICS, "Tissue is softer where it was deformed before.", ("part",), ("",), variants)


def _strain_path(protocol: Protocol, chain: Chain) -> Floats:
    """Strain path (n,) of a chain, over its largest strain."""
    tests = [protocol.tests[k] for k in chain.tests]
    ends = np.concatenate([[0.0], np.cumsum([test.strain_path[-1] * test.reach for test in tests])])
    each = [end + test.strain_path * test.reach for end, test in zip(ends, tests, strict=False)]
    return np.concatenate(each) / max(test.reach for test in tests)


def _below(protocol: Protocol, chain: Chain) -> Floats:
    I = first_invariant(protocol.tests[chain.tests[0]].mode, chain.strain)
    return np.asarray(1.0 - I / np.maximum(np.maximum.accumulate(I), 1e-12))


def _cycles(protocol: Protocol, chain: Chain) -> Floats:
    return np.asarray(-np.expm1(-((_strain_path(protocol, chain) / belief("specimen.softening_way")) ** 2)))


def _act(pattern: Pattern) -> Callable[[float, Baseline], Action]:
    def act(part: float, rows: Baseline) -> Action:
        found = np.zeros(len(rows.protocol))
        for chain in rows.protocol.chains:
            found[rows.protocol.mask(chain.tests)] = pattern(rows.protocol, chain)
        return Action(factor=1.0 - np.clip(part, 0.0, 0.95) * found)

    return act
