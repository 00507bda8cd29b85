"""Explanations that are no physics: nuisances far larger than they should be, which compete with mechanisms."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.inference.beliefs import belief
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.nuisances import Nuisances
from warpbrain.worlds.body.sensors import Sensors, alike_near, spread_points
from warpbrain.worlds.body.stiffness_field import stiffness_modes

Floats = NDArray[np.float64]

#: What each says to people.
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
    sensors, mesh = at.sensors, at.system.model.mesh
    by_name = {family.name: family.columns for family in nuisances.families}
    wide = {
        "registration": sensors.rigid
        * np.repeat([belief("registration.wrong_shift"), belief("registration.wrong_turn")], 3),
        "stiffness": belief("tissue.larger")
        * at.answers_of_elements(at.element_forces, stiffness_modes(mesh, int(belief("tissue.wrong_modes")))),
        "loads": belief("tissue.larger") * by_name["known loads"],
    }
    if "mesh" in by_name:
        wide["mesh"] = belief("tissue.larger") * by_name["mesh"]
    wide["segmentation"] = _off_surfaces(sensors)
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
    found[rows, np.arange(len(rows))] = belief("loads.force") * np.sqrt(squares[groups])
    return found


def _off_surfaces(sensors: Sensors) -> Floats:
    """Columns (n, k) of recorded surfaces that are off: shifted from place to place, or too far out or in."""
    rows = np.flatnonzero(sensors.of_surfaces)
    where = sensors.positions[rows]
    near = alike_near(
        where, where[spread_points(where, belief("mesh.surface_alike"), 60)], belief("mesh.surface_alike")
    )
    along = np.column_stack([sensors.directions[rows], np.ones(len(rows))])
    found = np.zeros((len(sensors), 4 * near.shape[1]))
    found[rows] = (
        belief("mesh.surface_off")
        / np.sqrt(2.0)
        * (near[:, :, None] * along[:, None, :]).reshape(len(rows), 4 * near.shape[1])
    )
    return found
