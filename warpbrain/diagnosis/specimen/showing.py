"""Where in the tests a mechanism shows, and the smallest of each that would."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.specimen.fitting import SpecimenFit
from warpbrain.diagnosis.specimen.protocol import Protocol, Test
from warpbrain.diagnosis.specimen.result import Segment
from warpbrain.diagnosis.specimen.screening import Columns
from warpbrain.worlds.body.parameters import SEEN
from warpbrain.worlds.body.values import Smallest

Floats = NDArray[np.float64]

#: Movement between rows, over the largest strain, below which a test rests.
_STILL = 0.002


def segments_of(test: Test) -> NDArray[np.str_]:
    """What each row (n,) of a test is part of: loading, unloading or a hold."""
    strain = np.abs(test.strain - test.rest)
    moves = np.gradient(strain) / max(float(strain.max()), 1e-12)
    return np.where(np.abs(moves) < _STILL, "hold", np.where(moves > 0.0, "loading", "unloading"))


def where_it_shows(protocol: Protocol, without: Floats, with_it: Floats) -> Segment:
    """The segment in which squared errors, over the largest stress of the test, fall most.

    Parameters
    ----------
    protocol : Protocol
    without, with_it : (n,) array
        Simulated stress [Pa].
    """
    best, most = None, -np.inf
    for number in protocol.to_fit:
        test, rows = protocol.tests[number], protocol.rows[number]
        gain = ((test.stress - without[rows]) ** 2 - (test.stress - with_it[rows]) ** 2) / test.peak**2
        names = segments_of(test)
        for name in dict.fromkeys(names.tolist()):
            for side in (test.strain >= test.rest, test.strain < test.rest):
                own = (names == name) & side
                if own.any() and float(gain[own].sum()) > most:
                    most = float(gain[own].sum())
                    strain = (float(test.strain[own].min()), float(test.strain[own].max()))
                    time = None if test.time is None else (float(test.time[own].min()), float(test.time[own].max()))
                    best = Segment(test.name, test.mode, name, strain, time)
    assert best is not None
    return best


def smallest_of(fit: SpecimenFit, columns: Sequence[Columns]) -> dict[str, Smallest]:
    """Of each kind, the size of its first number that is seen nearly always; its ways alike, the plainest counts."""
    found: dict[str, Smallest] = {}
    most: dict[str, float] = {}
    for one in columns:
        if one.assumption is None:
            continue
        d = fit.explanation.detectability(fit.explanation.whitened(one.columns[:, :1])[:, 0], fit.kappa)
        if d <= most.get(one.kind, 0.0):
            continue
        most[one.kind] = d
        way = one.assumption
        expected = way.values(way.mean)[0]
        if one.expects:
            size = SEEN / d * abs(expected)
        else:
            z = np.zeros(len(way.mean))
            z[0] = min(SEEN / d, 100.0)
            size = abs(way.values(way.mean + way.sd * z)[0] - expected)
        found[one.kind] = Smallest(size, way.units[0], way.names[0])
    return found
