"""How large a cause is at each time, where its size was found as a function of time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.physics.proposal import Varying
from warpbrain.physics.words import label
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.parameters import mechanism_numbers


@dataclass(frozen=True)
class SizeOverTime:
    """One parameter of a mechanism at the recorded times."""

    #: Its name, and what it is in words.
    parameter: str
    says: str
    unit: str
    #: Times [s], and the parameter with its standard deviation in `unit`.
    seconds: tuple[float, ...]
    values: tuple[float, ...]
    deviations: tuple[float, ...]


def size_over_time(effect: Effect, z: Floats, covariance: Floats) -> SizeOverTime | None:
    """The parameter that changes most, to first order; None if the size of an effect is no function of time.

    `z` (k,): its coordinates. `covariance` (k, k): of these.
    """
    varying = effect.proposed.over_time
    if varying is None:
        return None
    found = _numbers(varying, effect.coefficients(z))
    # of a vector its length
    spans = {
        name: float(np.ptp(values) / max(np.abs(values).max(), 1e-300))
        for name, (values, _) in found.items()
        if not name.endswith(("_x", "_y", "_z"))
    }
    if not spans:
        return None
    name = max(spans, key=lambda one: spans[one])
    values, unit = found[name]
    spread, along = np.linalg.eigh(covariance)
    factor = along * np.sqrt(np.maximum(spread, 0.0))
    changes = [(_values(varying, effect.coefficients(z + 0.1 * column), name) - values) / 0.1 for column in factor.T]
    says = varying.base.make(varying.base.mean).parameters()[name.removesuffix("_size")].doc
    return SizeOverTime(
        name,
        label(says),
        unit,
        tuple(varying.times.tolist()),
        tuple(values.tolist()),
        tuple(np.linalg.norm(changes, axis=0).tolist()),
    )


def _numbers(varying: Varying, c: Floats) -> dict[str, tuple[Floats, str]]:
    """Parameters over time (m,) with units, by name."""
    by_time = [mechanism_numbers(varying.base.make(varying.at(c, time))) for time in varying.times.tolist()]
    names = [name for name in by_time[0] if name != "share" and all(name in numbers for numbers in by_time)]
    return {name: (np.array([numbers[name][0] for numbers in by_time]), by_time[0][name][1]) for name in names}


def _values(varying: Varying, c: Floats, name: str) -> Floats:
    return _numbers(varying, c)[name][0]
