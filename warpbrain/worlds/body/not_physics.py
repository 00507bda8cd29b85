"""Explanations that are no physics: nuisances far larger than expected, which compete with mechanisms."""

from __future__ import annotations

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference.beliefs import belief
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.nuisances import Nuisances
from warpbrain.worlds.body.sensors import Sensors, kernel_columns, spread_points

#: What each means, in a sentence.
SENTENCES = {
    "registration": "Recordings and anatomy are registered wrongly.",
    "mesh": "The mesh is too coarse, or not the shape of the anatomy.",
    "stiffness": "Stiffness varies more from place to place than brain tissue is known to.",
    "loads": "The known loads are not as large as was said.",
    "segmentation": "A recorded surface, or that of the anatomy, is not where it was found.",
    "forces": "A recorded force is not the one that acted, or has another direction.",
}


def not_physics_at(at: Linearisation, nuisances: Nuisances) -> dict[str, Effect]:
    """Effects by name."""
    sensors = at.sensors
    by_name = nuisances.families
    columns_by_name = {
        "registration": sensors.rigid
        * np.repeat([belief("registration.wrong_shift") * sensors.radius, belief("registration.wrong_turn")], 3),
        "stiffness": belief("tissue.larger") * by_name["stiffness field"],
        "loads": belief("tissue.larger") * by_name["known loads"],
    }
    if "mesh" in by_name:
        columns_by_name["mesh"] = belief("tissue.larger") * by_name["mesh"]
    columns_by_name["segmentation"] = _off_surfaces(sensors)
    columns_by_name["forces"] = _wrong_forces(sensors)
    zero = np.zeros(len(sensors))
    return {name: Effect(None, zero, columns) for name, columns in columns_by_name.items() if columns.any()}


def _wrong_forces(sensors: Sensors) -> Floats:
    """Columns (n, k) of each component of the recorded forces, which may be wrong in size and in direction."""
    rows = np.flatnonzero(~sensors.is_displacement)
    groups = sensors.groups[rows]
    recorded = sensors.computed[rows] + sensors.residual[rows]
    squares = np.bincount(groups, weights=recorded**2, minlength=1)
    columns = np.zeros((len(sensors), len(rows)))
    columns[rows, np.arange(len(rows))] = belief("loads.force") * np.sqrt(squares[groups])
    return columns


def _off_surfaces(sensors: Sensors) -> Floats:
    """Columns (n, k) of recorded surfaces that are off: shifted from place to place, or too far out or in."""
    rows = np.flatnonzero(sensors.of_surfaces)
    places = sensors.positions[rows]
    reach = belief("mesh.surface_alike") * sensors.radius
    weights = kernel_columns(places, places[spread_points(places, reach, 60)], reach)
    coordinates = np.column_stack([sensors.directions[rows], np.ones(len(rows))])
    columns = np.zeros((len(sensors), 4 * weights.shape[1]))
    columns[rows] = (
        belief("mesh.surface_off")
        * sensors.radius
        / np.sqrt(2.0)
        * (weights[:, :, None] * coordinates[:, None, :]).reshape(len(rows), 4 * weights.shape[1])
    )
    return columns
