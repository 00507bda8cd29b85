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

#: What each says to people.
SENTENCES = {
    "registration": "Recordings and anatomy are registered wrongly.",
    "mesh": "The mesh is too coarse, or not the shape of the anatomy.",
    "stiffness": "Stiffness varies more from place to place than brain tissue is known to.",
    "loads": "The known loads are not as large as was said.",
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
    nothing = np.zeros(len(sensors))
    return {name: Effect(None, nothing, columns) for name, columns in wide.items() if columns.any()}
