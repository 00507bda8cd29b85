"""Small forces at a state: by the compliance, by equilibria, and by a dense solution of the whole."""

import copy

import numpy as np
import pytest

from warpbrain.mesh import vertex_normals
from warpbrain.worlds.body.linearisation import Linearisation


@pytest.fixture(scope="module")
def at(small_diagnosis) -> Linearisation:
    return small_diagnosis.base.at


def test_few_forces_are_answered_without_the_compliance(at):
    beside = at.with_sensors(at.sensors)
    forces = np.random.default_rng(0).normal(size=(3, len(at.u), 3))
    few = beside.answers(forces)
    assert "_rows" not in beside.__dict__
    rows, which = at._rows
    np.testing.assert_allclose(few, np.tensordot(rows[which], forces.reshape(3, -1), (1, 1)), atol=1e-9 * few.max())


def test_patches_are_forces_at_their_nodes(at, monkeypatch):
    weights = np.random.default_rng(2).random((len(at.u), 150))
    found = at.answers_of_patches(weights)
    assert found.shape == (len(at.sensors), 150, 3)
    some = np.zeros((3, *at.u.shape))
    for axis in range(3):
        some[axis, :, axis] = weights[:, 70]
    np.testing.assert_allclose(found[:, 70], at.answers(some), rtol=1e-9, atol=1e-12 * np.abs(found).max())
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    np.testing.assert_array_equal(at.answers_of_patches(weights), found)


def test_what_lets_go_is_what_a_dense_solution_says(at):
    mesh = at.system.model.mesh
    held = at.system.model.constrained.all(axis=1)
    # a corner of what is held, of which the rest stays
    patch = held & (mesh.points[:, 0] < 0.025)
    # the block is not loaded: forces that something else holds it with
    loaded = copy.copy(at)
    loaded._surfaces, loaded._of_surfaces = {}, {}
    loaded.reactions = 1e-4 * np.random.default_rng(1).normal(size=at.u.shape)
    found = loaded.released(patch, held, lifts=False)
    normals = vertex_normals(mesh)[patch]
    K = at.stiffness.toarray()
    members = np.flatnonzero(patch)
    # along the surface only: a frame of two tangents for each node
    tangents = [np.linalg.svd(n[None])[2][1:] for n in normals]
    free = np.flatnonzero(~at.system.model.constrained.ravel())
    frame = np.zeros((len(K), len(free) + 2 * len(members)))
    frame[free, np.arange(len(free))] = 1.0
    for k, (node, own) in enumerate(zip(members, tangents, strict=True)):
        frame[3 * node : 3 * node + 3, len(free) + 2 * k : len(free) + 2 * k + 2] = own.T
    load = np.zeros(len(K))
    load.reshape(-1, 3)[members] = -loaded.reactions[members]
    du = frame @ np.linalg.solve(frame.T @ K @ frame, frame.T @ load)
    expected = at.sensors.by_displacement @ du
    np.testing.assert_allclose(found, expected, atol=1e-8 * np.abs(expected).max())


def test_reactions_to_further_forces_balance_them(at):
    forces = np.random.default_rng(3).normal(size=at.u.shape)
    reactions = at.reactions_to(forces)
    assert not reactions.ravel()[at.free].any()
    np.testing.assert_allclose(reactions.sum(axis=0), -forces.sum(axis=0), atol=1e-6 * np.abs(forces).sum())


@pytest.mark.parametrize("lifts", [False, True])
def test_what_lets_go_beside_further_forces_is_what_does_where_they_act_already(at, lifts):
    held = at.system.model.constrained.all(axis=1)
    patch = held & (at.system.model.mesh.points[:, 0] < 0.025)
    more = at.reactions_to(1e-4 * np.random.default_rng(1).normal(size=at.u.shape))
    loaded = copy.copy(at)
    loaded._surfaces, loaded._surface_responses = {}, {}
    loaded.reactions = at.reactions + more
    expected = loaded.released(patch, held, lifts)
    found = at.released(patch, held, lifts, more)
    np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())
    assert np.abs(expected).max() > 0.0
