"""The force on what holds a body, recorded beside what was recorded of it."""

from dataclasses import replace

import numpy as np

from warpbrain.worlds.body.linearisation import Linearisation


def with_reaction(at: Linearisation) -> Linearisation:
    """The same state with three sensors more: what holds the held nodes together, along each axis [N]."""
    base = at.sensors
    nodes = at.system.model.constrained.reshape(-1, 3).all(axis=1)
    sums = np.zeros((3, 3 * len(nodes)))
    for axis in range(3):
        sums[axis, axis::3] = nodes
    of_rows = base.of_rows(np.r_[np.arange(len(base)), [0, 1, 2]], np.inf)
    own = slice(len(base), None)
    by_displacement, by_reactions = of_rows.by_displacement.tolil(), of_rows.by_reactions.tolil()
    by_displacement[own], by_reactions[own] = 0.0, sums
    directions, groups = of_rows.directions.copy(), of_rows.groups.copy()
    directions[own], groups[own] = 0.0, base.groups.max() + 1
    return at.with_sensors(
        replace(
            of_rows,
            by_displacement=by_displacement.tocsr(),
            by_reactions=by_reactions.tocsr(),
            directions=directions,
            groups=groups,
        )
    )
