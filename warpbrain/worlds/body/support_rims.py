"""What is not known of where a support ends, as columns about a state.

A mesh has the rim of what is held at its nodes: whether one there is held is a matter of where the mesher put it, by
half an edge. Beside a rim a load moves recorded points by much more or less if the support ends elsewhere, which
smaller elements with the same faces do not show, and what is left of it looks like a support that gives way. So each
node of a rim carries a part more or less of its reaction than it does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpbrain.arrays import Floats, Ints
from warpbrain.inference.beliefs import belief, beliefs
from warpbrain.worlds.body.linearisation import Linearisation


@dataclass(frozen=True, eq=False)
class Rims:
    """Where supports end."""

    nodes: Ints  # (k,), held in all components, which share a face of the surface with one that is not held
    unseen: float  # motion of such a node [m] that no recording sees

    @classmethod
    def of(cls, at: Linearisation) -> Rims:
        """Those of a case, from a state of it."""
        model, sensors = at.system.model, at.sensors
        faces, components = model.mesh.boundary, model.constrained.sum(axis=1)
        ends = np.zeros(len(components), dtype=bool)
        ends[faces[(components[faces] == 0).any(axis=1)]] = True
        noise = sensors.sigma[sensors.is_displacement]
        if len(noise) and not np.isnan(noise).any():
            unseen = belief("supports.unseen") * float(np.median(noise))
        else:
            unseen = float(beliefs("mesh.unknown").min() * np.linalg.norm(at.u, axis=1).max())
        return cls(np.flatnonzero(ends & (components == 3)), unseen)


def rim_columns(at: Linearisation, rims: Rims) -> Floats:
    """Change of what is recorded (n, k) by one standard deviation of the part of its reaction that each node carries.

    Zero of nodes that nothing holds at the state. The variance of their motion is less by what no recording sees: few
    columns are left, and none comes or goes at once where a state changes a little.
    """

    def about(state: Linearisation) -> Floats:
        columns, give = np.zeros((len(state.sensors), len(rims.nodes))), state.own_give(rims.nodes)
        motion = belief("supports.rim") * np.linalg.norm(give, axis=1)
        seen = np.flatnonzero(motion > rims.unseen)
        sizes = belief("supports.rim") * np.sqrt(1.0 - (rims.unseen / motion[seen]) ** 2)
        columns[:, seen] = sizes * state.released_each(rims.nodes[seen])
        return columns

    return at.summed(about)
