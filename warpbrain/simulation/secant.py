"""What a switch does: the equilibrium with it less the equilibrium without.

Contact that is stuck, slides or lifts off, a falx or a resection that is there or not: nothing lies between two such
states, and so there is no derivative. The whole difference stands where a derivative would.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Floats
from warpbrain.simulation.equilibrium import EquilibriumOptions, solve_equilibrium
from warpbrain.simulation.model import Model
from warpbrain.simulation.system import System


@dataclass(frozen=True, eq=False)
class Secant:
    """A difference of two equilibria.

    Attributes
    ----------
    nodes : (n,) int array
        Ids, in the model without, of the nodes that both models have.
    u : (n, 3) array
        Displacement with less that without [m].
    reactions : (n, 3) array
        Of what holds them [N].
    """

    nodes: NDArray[np.int64]
    u: Floats
    reactions: Floats


def secant(
    without: Model,
    present: Model,
    nodes: NDArray[np.integer] | None = None,
    options: EquilibriumOptions | None = None,
    device: str | None = None,
) -> Secant:
    """The difference that a switch makes.

    Parameters
    ----------
    without, present : Model
        Alike but for the switch.
    nodes : (n,) int array, optional
        For each node of `present` its id in `without`; the same ones by default. A resection leaves some.
    options : EquilibriumOptions, optional
    device : str, optional

    Raises
    ------
    SolveError
        If one of the two has no equilibrium.
    """
    shared = np.arange(len(present.mesh.points)) if nodes is None else np.asarray(nodes, dtype=np.int64)
    found = []
    for model in (present, without):
        state = solve_equilibrium(System(model, device), options)
        found.append((state.u, model.reactions(state.internal, model.external_forces())))
    (u, reactions), (u_without, reactions_without) = found
    return Secant(shared, u - u_without[shared], reactions - reactions_without[shared])
