"""Explanations that are no physics: nuisances far larger than they should be, which compete with mechanisms."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.effects import Effect
from warpbrain.diagnosis.nuisances import Nuisances
from warpbrain.diagnosis.sensors import Sensors

Floats = NDArray[np.float64]

#: Standard deviations of a registration that went wrong: shift [m] and turn [rad].
_SHIFT, _TURN = 0.01, math.radians(10.0)
#: How much larger than it should be another nuisance is.
_LARGER = 4.0
#: Standard deviation of each component of a force that was measured wrongly, as a part of what was recorded.
_FORCE = 0.3

#: What each says to people.
SENTENCES = {
    "registration": "Recordings and anatomy are registered wrongly.",
    "mesh": "The mesh is too coarse, or not the shape of the anatomy.",
    "stiffness": "Stiffness varies more from place to place than brain tissue is known to.",
    "loads": "The known loads are not as large as was said.",
    "forces": "A recorded force is not the one that acted, or has another direction.",
}


def alternatives_at(sensors: Sensors, nuisances: Nuisances) -> dict[str, Effect]:
    """Effects by name."""
    by_name = {family.name: family.columns for family in nuisances.families}
    wide = {
        "registration": sensors.rigid * np.repeat([_SHIFT, _TURN], 3),
        "stiffness": _LARGER * by_name["stiffness field"],
        "loads": _LARGER * by_name["known loads"],
    }
    if "mesh" in by_name:
        wide["mesh"] = _LARGER * by_name["mesh"]
    wide["forces"] = _wrong_forces(sensors)
    nothing = np.zeros(len(sensors))
    return {name: Effect(None, nothing, columns) for name, columns in wide.items() if columns.any()}


def _wrong_forces(sensors: Sensors) -> Floats:
    """Columns (n, k) of each component of the recorded forces, which may be wrong in size and in direction."""
    rows = np.flatnonzero(~sensors.is_displacement)
    groups = sensors.groups[rows]
    recorded = sensors.computed[rows] + sensors.residual[rows]
    squares = np.bincount(groups, weights=recorded**2, minlength=1)
    found = np.zeros((len(sensors), len(rows)))
    found[rows, np.arange(len(rows))] = _FORCE * np.sqrt(squares[groups])
    return found
