"""Bodies that creep: how much of a response in the end there is at the time when something was recorded.

Tissue whose stress relaxes has, of strain that is held, `G(t) = 1 + left(t)` times the stress of the end. Under a load
that came at once and stays its displacement is `J(t)` times that of the end,

    int_0^t G(t - s) dJ(s) = 1,    J(0) = 1 / G(0),

(Ferry 1980, Viscoelastic Properties of Polymers, 3rd ed., section 3.B), solved by steps whose moduli are the means of
those of their ends (Hopkins and Hamming 1957, J. Appl. Phys. 28, 906). It lags behind `1 / G(t)`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.physics.mechanism import Changed

#: What has a response: that of a mechanism, or something of which the response is known at each time.
Changes = Changed | Literal["known"]
#: Ends of the steps, relative to the time.
_STEPS = np.unique(np.concatenate([np.geomspace(1e-3, 1.0, 25), np.linspace(0.0, 1.0, 41)]))


def crept(left: Callable[[Floats], Floats], time: float) -> float:
    """Displacement at a time [s] under a load that stays, relative to that in the end.

    `left`: from the time since strain came (...) [s] to the stress that has not relaxed, relative to that in the end.
    """
    from scipy.linalg import solve_triangular

    ends = time * _STEPS
    G = 1.0 + left(np.abs(ends[:, None] - ends))
    first = 1.0 / G[0, 0]
    of_steps = 0.5 * (G[1:, :-1] + G[1:, 1:])
    return first + float(solve_triangular(of_steps, 1.0 - G[1:, 0] * first, lower=True).sum())


class Reached(NamedTuple):
    """How many times the response in the linear model about the end of a course rows (k,) have at their time."""

    by_loads: Floats
    by_stiffness: Floats

    def by(self, changes: Changes) -> Floats:
        """By what changes."""
        parts = {"loads": self.by_loads, "stiffness": self.by_stiffness}
        return parts.get(changes, np.ones(len(self.by_loads)))


@dataclass(frozen=True, eq=False)
class Creep:
    """Parts (t,) of responses that there are at each time, where a body creeps to a state under loads that stay.

    The stiffness of the linear model is that without what relaxes. So a further load has, at each time, as large a part
    of its response as the displacement is of that to which the body would come at last; another stiffness, whose forces
    are those of the state, as the displacement is of that of the state. Loads and their reactions balance at any time.
    """

    by_loads: Floats  # of displacements
    by_stiffness: Floats
    of_reactions: Floats  # by another stiffness

    def at(self, numbers: Ints, is_displacement: Bools) -> Reached:
        """Of rows at times of these numbers (n,), -1 of the state itself."""
        by_loads = np.where(is_displacement, self.by_loads[numbers], 1.0)
        return Reached(by_loads, np.where(is_displacement, self.by_stiffness[numbers], self.of_reactions[numbers]))
