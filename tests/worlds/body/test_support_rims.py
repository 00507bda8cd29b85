"""Where supports end: which nodes these are, and what one does that carries less of its reaction."""

from dataclasses import replace

import numpy as np
import pytest

from warpbrain.inference.beliefs import belief, beliefs
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.system import System
from warpbrain.worlds.body.nuisances import RIMS
from warpbrain.worlds.body.support_rims import Rims, rim_columns

#: Part of its reaction that a node no longer carries, small enough for first order.
_LESS = 1e-3


@pytest.fixture(scope="module")
def sunk(small_diagnosis):
    """The linear model about a block, whose lower face is held, that hangs on it by its weight."""
    return small_diagnosis.best.refit.state.linearised()


def test_a_face_ends_at_its_edges(sunk):
    points = sunk.system.model.mesh.points
    sides, low = points[:, :2], points[:, 2] < 1e-9
    at_sides = (np.abs(sides - sides.min(axis=0)) < 1e-9) | (np.abs(sides - sides.max(axis=0)) < 1e-9)
    np.testing.assert_array_equal(Rims.of(sunk).nodes, np.flatnonzero(low & at_sides.any(axis=1)))


def test_a_node_that_carries_less_moves_as_an_equilibrium_says(sunk, verify):
    """The node is free and pulled by what is left of its reaction."""
    model, nodes = sunk.system.model, Rims.of(sunk).nodes
    node = int(nodes[np.argmax(np.linalg.norm(sunk.reactions[nodes], axis=1))])
    constrained = model.constrained.copy()
    constrained[node] = False
    external = model.external_forces()
    external[node] += (1.0 - _LESS) * sunk.reactions[node]
    system = System(replace(model, constrained=constrained))
    solver = EquilibriumSolver(system, EquilibriumOptions(tolerance=1e-10))
    moved = (solver.solve(external, sunk.u).u - sunk.u) / _LESS
    expected = sunk.sensors.by_displacement @ moved.ravel()
    [found] = sunk.released_each(np.array([node])).T
    verify(
        "recorded displacement where a node at the rim of a support carries less, largest error",
        "an equilibrium with the node free and pulled by the rest of its reaction",
        np.abs(found - expected).max() / np.abs(expected).max(),
        0.01,
    )


def test_each_node_is_let_go_alone(sunk):
    nodes = Rims.of(sunk).nodes[:5]
    together = sunk.released_each(nodes)
    alone = np.hstack([sunk.released_each(nodes[k : k + 1]) for k in range(5)])
    np.testing.assert_allclose(together, alone, atol=1e-9 * np.abs(together).max())


def test_what_no_recording_sees_has_no_column(sunk):
    rims = Rims.of(sunk)
    all_seen, some = rim_columns(sunk, replace(rims, unseen=0.0)), rim_columns(sunk, rims)
    np.testing.assert_allclose(
        all_seen, belief("supports.rim") * sunk.released_each(rims.nodes), atol=1e-12 * np.abs(all_seen).max()
    )
    seen = some.any(axis=0)
    sizes, of_all = (np.linalg.norm(columns, axis=0) for columns in (some, all_seen))
    assert seen.any() and (sizes[seen] < of_all[seen]).all()
    noise = np.median(sunk.sensors.sigma)
    assert np.linalg.norm(all_seen[:, ~seen] / noise, axis=0).max(initial=0.0) < 1.0
    assert not rim_columns(sunk, replace(rims, unseen=np.inf)).any()


def test_where_no_noise_is_declared_it_is_relative_to_what_moves(sunk):
    undeclared = sunk.with_sensors(replace(sunk.sensors, sigma=np.full(len(sunk.sensors), np.nan)))
    least = beliefs("mesh.unknown").min() * np.linalg.norm(sunk.u, axis=1).max()
    assert Rims.of(undeclared).unseen == pytest.approx(least)


def test_a_node_that_nothing_holds_has_no_column(sunk):
    """Such as one of a support that a hypothesis lets slide."""
    free = int(np.flatnonzero(~sunk.system.model.constrained.any(axis=1))[0])
    assert not rim_columns(sunk, Rims(np.array([free]), 0.0)).any()


def test_fits_have_the_rims_of_the_base(small_diagnosis, sunk):
    base, refit = small_diagnosis.base, small_diagnosis.best.refit
    part = base.nuisances.part(RIMS)
    np.testing.assert_allclose(
        refit.columns[:, part],
        rim_columns(sunk, base.nuisances.rims),
        atol=0.05 * np.abs(refit.columns[:, part]).max(initial=1e-12),
    )
