"""Toward an equilibrium with the stiffness of a state that is near: the chord method, accelerated.

Newton's method assembles and solves with a new tangent stiffness in each iteration. With the factors of one nearby, an
iteration costs internal forces and one solve, a fifth of that; earlier steps tell by how much the tangent differs
(`warpbrain.simulation.multisecant`). The result is a start for Newton's method, which checks the residual.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.simulation.multisecant import Multisecant
from warpbrain.simulation.system import System

#: Iterations at most, and what a residual must have fallen to after two of them.
_MOST, _FALLS = 12, 0.5


def toward_equilibrium(
    system: System, external: Floats, start: Floats, inverse: Callable[[Floats], Floats], tolerance: float
) -> Floats:
    """The displacement (n, 3) [m] with the smallest residual on the way from a start.

    Parameters
    ----------
    system : System
    external : (n, 3) array
        Nodal forces [N].
    start : (n, 3) array
        Displacement [m] of a state nearby.
    inverse : callable
        From nodal forces (n, 3) [N] to the displacement (n, 3) [m] that they cause there; zero where nodes are held.
    tolerance : float
        Of the out-of-balance force, relative to all nodal forces.
    """
    model = system.model
    u, free = np.where(model.constrained, model.prescribed, start), ~model.constrained
    system.set_time_step(math.inf)
    system.forget()
    system.set_load()
    secants = Multisecant()
    best, norms = u, [np.inf, np.inf]
    for _ in range(_MOST):
        system.u.assign(u)
        system.evaluate_forces()
        system.gather_forces()
        internal = system.internal.numpy().astype(np.float64)
        r = free * (external - internal)
        norm = float(np.linalg.norm(r))
        if not norm < _FALLS * norms[-2]:
            break
        if norm < min(norms):
            best = u
        norms.append(norm)
        if norm <= tolerance * float(np.linalg.norm(internal) + np.linalg.norm(external)):
            break
        known, left = secants.split(u, r)
        u = u + known + inverse(left)
    return best
