"""A zero of the force that drifts through the tests, or is wrong in them, by far more than gauges do."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.case import Case
from warpbrain.diagnosis.specimen.acting import Acting, Assumption, Unit
from warpbrain.diagnosis.specimen.protocol import Protocol

Floats = NDArray[np.float64]

KIND = "drift of the zero"
#: Standard deviation, of the largest stress.
_SIZE = 0.25


def assumptions(case: Case, protocol: Protocol) -> tuple[Assumption, ...]:
    """Of each chain a parabola over its time; of tests without times a constant."""
    columns, names = [], []
    for chain in protocol.chains:
        rows = protocol.mask(chain.tests)
        peak = max(protocol.tests[k].peak for k in chain.tests)
        first = protocol.tests[chain.tests[0]].name
        shapes = [np.ones(len(chain.strain))]
        if chain.time is not None:
            s = (chain.time - chain.time[0]) / max(float(np.ptp(chain.time)), 1e-12)
            shapes += [s, s * (1.0 - s)]
        for power, shape in enumerate(shapes):
            column = np.zeros(len(protocol))
            column[rows] = peak * shape
            columns.append(column)
            names.append(f"{first}, {('constant', 'line', 'parabola')[power]}")
    together = np.column_stack(columns)

    def act(c: Floats, unit: Unit) -> Acting:
        return Acting(added=together @ c)

    return (
        Assumption(
            kind=KIND,
            physics=False,
            sentence="The zero of the force drifts, or is wrong.",
            names=tuple(names),
            units=("of the largest stress",) * len(names),
            mean=np.zeros(len(names)),
            sd=np.full(len(names), _SIZE),
            act=act,
            values=lambda c: tuple(float(x) for x in c),
        ),
    )
