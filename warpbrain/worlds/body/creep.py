"""Creep of bodies under constant loads: the fraction of a linear response that is reached when a row is recorded.

With the relaxation modulus `G(t)` and the creep compliance `J(t)`, both relative to those in equilibrium,

    int_0^t G(t - s) dJ(s) = 1,    J(0) = 1 / G(0),

(Ferry 1980, Viscoelastic Properties of Polymers, 3rd ed., section 3.B), solved by steps whose moduli are the means of
those of their ends (Hopkins and Hamming 1957, J. Appl. Phys. 28, 906). `J` lags behind `1 / G`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.physics.mechanism import Changed

#: What is perturbed: `Mechanism.changes`, or something whose response at each time is known already.
Perturbation = Changed | Literal["known"]
#: Ends of the steps, relative to the time.
_STEPS = np.unique(np.concatenate([np.geomspace(1e-3, 1.0, 25), np.linspace(0.0, 1.0, 41)]))


def creep_function(relaxing_modulus: Callable[[Floats], Floats], time: float) -> float:
    """Displacement at a time [s] under a constant load, relative to that after an infinite time.

    `relaxing_modulus`: from times since a strain was imposed (...) [s] to the part of the relaxation modulus that
    decays (...), relative to the equilibrium modulus.
    """
    from scipy.linalg import solve_triangular

    ends = time * _STEPS
    G = 1.0 + relaxing_modulus(np.abs(ends[:, None] - ends))
    first = 1.0 / G[0, 0]
    of_steps = 0.5 * (G[1:, :-1] + G[1:, 1:])
    return first + float(solve_triangular(of_steps, 1.0 - G[1:, 0] * first, lower=True).sum())


class CreepFactors(NamedTuple):
    """Factors (k,) by which the linear response at the end of a course gives that of rows at their own times."""

    by_loads: Floats
    by_stiffness: Floats

    @classmethod
    def none(cls, count: int) -> CreepFactors:
        """Of rows of a body that does not creep: 1."""
        return cls(np.ones(count), np.ones(count))

    def of(self, perturbation: Perturbation) -> Floats:
        """On the response to a perturbation."""
        return {"loads": self.by_loads, "stiffness": self.by_stiffness}.get(perturbation, np.ones(len(self.by_loads)))


@dataclass(frozen=True, eq=False)
class Creep:
    """Creep factors at each of t times of a body under constant loads.

    The tangent stiffness of the linear model is the equilibrium one. A further load therefore has, at each time, the
    fraction of its response that the displacement is of that after an infinite time. A change of stiffness has forces
    in proportion to the strain of the state about which it is linear, and the fraction that the displacement is of that
    of this state. Reactions balance loads at any time.
    """

    by_loads: Floats  # (t,), of displacements
    by_stiffness: Floats  # (t,), of displacements
    of_reactions: Floats  # (t,), of reactions to a change of stiffness

    def factors(self, numbers: Ints, is_displacement: Bools) -> CreepFactors:
        """Of rows (n,) at times of these numbers, -1 for the last one."""
        by_loads = np.where(is_displacement, self.by_loads[numbers], 1.0)
        by_stiffness = np.where(is_displacement, self.by_stiffness[numbers], self.of_reactions[numbers])
        return CreepFactors(by_loads, by_stiffness)
