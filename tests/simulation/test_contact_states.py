"""What a switch of contact does: differences of two equilibria."""

from dataclasses import replace

import numpy as np
from shapes import cube

from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.mechanisms.contact import Contact
from warpbrain.simulation.equilibrium import solve_equilibrium
from warpbrain.simulation.model import Material, Model, with_mechanisms
from warpbrain.simulation.system import System


def lifted() -> Model:
    """A block whose top is moved up by a tenth."""
    mesh = cube(2)
    z = mesh.points[:, 2]
    sets = {"below": z < 1e-9, "above": z > 1.0 - 1e-9}
    mesh = replace(mesh, node_sets=sets)
    constrained = np.repeat(sets["above"][:, None], 3, axis=1)
    prescribed = np.where(constrained, [0.0, 0.0, 0.1], 0.0)
    return Model(mesh, {1: Material(NeoHookean(1000.0), 0.4)}, 1000.0, constrained, prescribed)


def test_of_contact_by_its_states() -> None:
    plain = lifted()
    slides, lifts = (with_mechanisms(plain, [Contact(nodes="below", state=state)]) for state in ("sliding", "lifting"))
    sliding, lifting, free = (solve_equilibrium(System(model)) for model in (slides, lifts, plain))
    # one that lifts off moves as a whole; one that slides keeps its foot on the table
    below = plain.mesh.node_sets["below"]
    assert np.abs((lifting.u - sliding.u)[below, 2] - 0.1).max() < 1e-4
    assert np.abs(free.u - lifting.u).max() < 1e-6
    # nothing holds what has lifted off
    held, loose = (state.internal[plain.constrained].reshape(-1, 3).sum(axis=0) for state in (sliding, lifting))
    assert np.abs(loose).max() < 1e-3 * np.abs(held).max()
