"""What a switch does: differences of two equilibria."""

from dataclasses import replace

import numpy as np
from shapes import cube

from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.mechanisms.contact import Contact
from warpbrain.physics.mechanisms.falx import Falx
from warpbrain.physics.mechanisms.resection import Resection
from warpbrain.simulation.equilibrium import solve_equilibrium
from warpbrain.simulation.model import Material, Model, with_mechanisms
from warpbrain.simulation.sensitivity import secant
from warpbrain.simulation.system import System


def lifted() -> Model:
    """A block whose top is moved up by a tenth."""
    mesh = cube(2)
    z = mesh.points[:, 2]
    corner = np.all(mesh.points > 0.4, axis=1)
    removed = corner[mesh.tetrahedra].all(axis=1)
    sets = {"below": z < 1e-9, "above": z > 1.0 - 1e-9, "wall": mesh.points[:, 0] < 1e-9}
    mesh = replace(mesh, node_sets=sets, element_sets={"resection": removed})
    constrained = np.repeat(sets["above"][:, None], 3, axis=1)
    prescribed = np.where(constrained, [0.0, 0.0, 0.1], 0.0)
    return Model(mesh, {1: Material(NeoHookean(1000.0), 0.4)}, 1000.0, constrained, prescribed)


def test_of_contact_by_its_states() -> None:
    plain = lifted()
    slides, lifts = (with_mechanisms(plain, [Contact(nodes="below", state=state)]) for state in ("sliding", "lifting"))
    found = secant(slides, lifts)
    # one that lifts off moves as a whole; one that slides keeps its foot on the table
    below = plain.mesh.node_sets["below"]
    assert np.abs(found.u[below, 2] - 0.1).max() < 1e-4
    assert np.abs(secant(lifts, plain).u).max() < 1e-6
    expected = -solve_equilibrium(System(slides)).internal[plain.constrained].reshape(-1, 3).sum(axis=0)
    assert np.abs(found.reactions.sum(axis=0) - expected).max() < 1e-3 * np.abs(expected).max()


def test_of_what_is_there_or_not() -> None:
    plain = lifted()
    held = replace(plain, constrained=plain.constrained | plain.mesh.node_sets["below"][:, None])
    membrane = with_mechanisms(held, [Falx(nodes="wall", stiffness=1e4, thickness=0.1)])
    states = [solve_equilibrium(System(model)).u for model in (held, membrane)]
    found = secant(held, membrane)
    np.testing.assert_array_equal(found.u, states[1] - states[0])
    assert np.abs(found.u).max() > 1e-4


def test_of_a_resection_on_the_nodes_that_are_left() -> None:
    plain = lifted()
    mesh, nodes = Resection().remaining(plain.mesh)
    whole = replace(plain, constrained=plain.constrained | plain.mesh.node_sets["below"][:, None])
    left = Model(mesh, whole.materials, 1000.0, whole.constrained[nodes], whole.prescribed[nodes])
    found = secant(whole, left, nodes)
    assert found.u.shape == mesh.points.shape and len(found.nodes) == len(nodes) < len(plain.mesh.points)
    expected = solve_equilibrium(System(left)).u - solve_equilibrium(System(whole)).u[nodes]
    np.testing.assert_array_equal(found.u, expected)
    assert np.abs(found.u).max() > 1e-4
