"""Numbers of fits for people: errors over all recorded rows, parameters, where a cause shows, what would be seen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Floats
from warpbrain.inference.beliefs import belief
from warpbrain.physics.values import Smallest, Value
from warpbrain.recordings.agreement import root_mean_square
from warpbrain.worlds.specimen.fit import Fit
from warpbrain.worlds.specimen.linear import Linear
from warpbrain.worlds.specimen.protocol import Protocol, Test
from warpbrain.worlds.specimen.result import Score, Segment

#: Movement between rows, over the largest strain, below which a test rests; step of differences.
_STILL, _STEP = 0.002, 1e-3


def score(protocol: Protocol, stress: Floats, held: Floats | None) -> Score:
    """Errors of stresses (n,) at all recorded rows [Pa]."""
    errors, fitted = protocol.observed - stress, protocol.mask(protocol.to_fit)
    check = {protocol.tests[k].name: root_mean_square(errors[protocol.rows[k]]) for k in protocol.to_check}
    outside = None if held is None else root_mean_square((protocol.observed - held)[fitted])
    return Score(root_mean_square(errors[fitted]), outside, check)


def values_of(fit: Fit, number: int) -> tuple[Value, ...]:
    """Parameters of one of the causes of a fit, with standard deviations to first order."""
    one, part = fit.assumed[number], fit.part(number)
    z = fit.z[part]
    here = np.array(one.variant.values(one.coefficients(z)))
    moved = [np.array(one.variant.values(one.coefficients(z + _STEP * move))) for move in np.eye(len(z))]
    slope = (np.array(moved) - here).T / _STEP
    sd = np.sqrt(np.maximum(np.diag(slope @ fit.covariance[part, part] @ slope.T), 0.0))
    return tuple(
        Value(name, float(value), float(s), unit)
        for name, value, s, unit in zip(one.effect.names, here, sd, one.effect.units, strict=True)
    )


def where_it_shows(protocol: Protocol, without: Floats, with_it: Floats) -> Segment:
    """The segment in which squared errors, over the largest stress of the test, fall most.

    Parameters
    ----------
    protocol : Protocol
    without, with_it : (n,) array
        Simulated stress [Pa].
    """
    found = []
    for number in protocol.to_fit:
        test, rows = protocol.tests[number], protocol.rows[number]
        gain = ((test.stress - without[rows]) ** 2 - (test.stress - with_it[rows]) ** 2) / test.peak**2
        names = segments_of(test)
        for name in dict.fromkeys(names.tolist()):
            for side in (test.strain >= test.rest, test.strain < test.rest):
                own = (names == name) & side
                if own.any():
                    strain = (float(test.strain[own].min()), float(test.strain[own].max()))
                    time = None if test.time is None else (float(test.time[own].min()), float(test.time[own].max()))
                    found.append((float(gain[own].sum()), Segment(test.name, test.mode, name, strain, time)))
    return max(found, key=lambda one: one[0])[1]


def segments_of(test: Test) -> NDArray[np.str_]:
    """What each row (n,) of a test is part of: loading, unloading or a hold."""
    strain = np.abs(test.strain - test.rest)
    moves = np.gradient(strain) / test.reach
    return np.where(np.abs(moves) < _STILL, "hold", np.where(moves > 0.0, "loading", "unloading"))


def smallest_of(about: Linear) -> dict[str, Smallest]:
    """Of each cause, the size of its first number that is seen nearly always; of its places the plainest counts."""
    found: dict[str, Smallest] = {}
    model = about.fit.model
    for cause, effect, trials in zip(about.causes, about.effects, about.trials, strict=True):
        if effect is None:
            continue
        seen = [float(np.linalg.norm(model.standardised(place.columns[:, :1]))) for place in cause.places]
        best = int(np.argmax(seen))
        variant, trial = trials[best]
        part = belief("specimen.seen") / max(seen[best], 1e-12)
        nothing, there = (
            variant.values(c)[0] for c in (variant.nothing, variant.nothing + part * (trial[0] - variant.nothing))
        )
        found[effect.name] = Smallest(abs(there - nothing), effect.units[0], effect.names[0])
    return found
