"""Toward an equilibrium with the stiffness of a state nearby, against Newton's method."""

from dataclasses import replace

import numpy as np
import pytest

from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.states import TOLERANCE


@pytest.fixture(scope="module")
def beside(small_diagnosis):
    """The base of a block that sinks, and a hypothesis in which it does."""
    base = small_diagnosis.base
    weight = Gravity(direction=(0.0, 0.0, -1.0), density=300.0)
    return base, replace(base.state.hypothesis, mechanisms=(weight,))


def _residual(system, external, u):
    system.u.assign(u)
    system.evaluate_forces()
    system.gather_forces()
    internal = system.internal.numpy()
    free = ~system.model.constrained
    return np.linalg.norm(free * (external - internal)) / (np.linalg.norm(internal) + np.linalg.norm(external))


def test_it_gets_where_newtons_method_gets(beside):
    base, hypothesis = beside
    other = base.states.solve(hypothesis)
    system = other.system
    external = system.model.external_forces()
    u = base.at.toward_equilibrium(system, external, base.state.u, TOLERANCE)
    assert _residual(system, external, base.state.u) > 100.0 * TOLERANCE
    assert _residual(system, external, u) <= TOLERANCE
    moved = np.abs(other.u - base.state.u).max()
    np.testing.assert_allclose(u, other.u, atol=1e-4 * moved)


def test_a_state_is_the_same_whichever_way_it_begins(beside):
    base, hypothesis = beside
    plain = base.states.solve(hypothesis, base.state.u)
    begun = base.states.solve(hypothesis, base.state.u, nearby=base.at)
    np.testing.assert_allclose(begun.u, plain.u, atol=1e-4 * np.abs(plain.u - base.state.u).max())


def test_where_it_gets_no_nearer_the_start_stays(beside):
    base, hypothesis = beside
    other = base.states.solve(hypothesis)
    system = other.system
    external = system.model.external_forces()
    # far from balance, and a stiffness of the wrong sign leads away
    wrong = base.at.with_sensors(base.at.sensors)
    wrong.displacements = lambda forces: -100.0 * Linearisation.displacements(base.at, forces)
    start = 0.5 * other.u
    np.testing.assert_array_equal(wrong.toward_equilibrium(system, external, start, TOLERANCE), start)
