"""What lifts off a wall, against the conditions that a contact has to obey, on a matrix of chance."""

import numpy as np
import pytest
from scipy.sparse import csr_matrix
from scipy.stats import special_ortho_group

from warpbrain.errors import SolveError
from warpbrain.worlds.body.factors import Factors
from warpbrain.worlds.body.held_surface import HeldSurface


@pytest.fixture
def problem():
    """Twelve nodes of which the last five are held; their matrix, normals and reactions."""
    random = np.random.default_rng(4)
    root = random.normal(size=(36, 36))
    K = root @ root.T + 12.0 * np.eye(36)
    normals = random.normal(size=(12, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    held = np.arange(12) >= 7
    reactions = np.where(held[:, None], random.normal(size=(12, 3)), 0.0)
    return K, normals, held, reactions


def surface_of(K, normals, held, reactions, size=100.0) -> HeldSurface:
    free = ~np.repeat(held, 3)
    return HeldSurface(csr_matrix(K), free, Factors(csr_matrix(K[free][:, free])), reactions, held, normals, size)


def test_what_lifts_off_is_not_pulled_and_what_stays_is_not_drawn_in(problem):
    K, normals, held, reactions = problem
    patch = held & (np.arange(12) != 9)
    moved = surface_of(*problem).moved(patch, True).reshape(-1, 3)
    own = np.repeat(held, 3)
    S = K[own][:, own] - K[own][:, ~own] @ np.linalg.solve(K[~own][:, ~own], K[~own][:, own])
    # back from tangents and normal to x, y, z
    along = np.linalg.svd(normals[held][:, None])[2][:, 1:]
    u = np.einsum("ak,aki->ai", moved, np.concatenate([along, normals[held][:, None]], axis=1))
    force = reactions[held] + (S @ u.ravel()).reshape(-1, 3)
    gap, pull = np.einsum("ai,ai->a", u, normals[held]), np.einsum("ai,ai->a", force, normals[held])
    on = patch[held]
    assert not u[~on].any()
    assert (gap[on] <= 1e-12).all() and (pull[on] <= 1e-9).all()
    np.testing.assert_allclose(gap[on] * pull[on], 0.0, atol=1e-9)
    # nothing holds it along the wall
    np.testing.assert_allclose((force - pull[:, None] * normals[held])[on], 0.0, atol=1e-9)
    assert (gap[on] < 0.0).any() and (pull[on] < 0.0).any()


def test_beside_a_following_pressure_it_is_the_same_in_any_axes(problem):
    """Whose tangent is not symmetric: what acts on free nodes changes with those that are held, and not back."""
    K, normals, held, reactions = problem
    own = np.repeat(held, 3)
    K[np.ix_(~own, own)] += np.random.default_rng(5).normal(size=(21, 15))
    moved = []
    for R in (np.eye(3), special_ortho_group.rvs(3, random_state=1)):
        turn = np.kron(np.eye(12), R)
        turned = turn @ K @ turn.T, normals @ R.T, held, reactions @ R.T
        surface = surface_of(*turned)
        u = np.einsum("ak,aki->ai", surface.moved(held, True).reshape(-1, 3), surface._frames)
        moved.append(u @ R)
    np.testing.assert_allclose(moved[1], moved[0], atol=1e-12)


def test_what_nothing_holds_any_more_is_no_neighbour(problem):
    with pytest.raises(SolveError, match="letting go of 5 nodes"):
        surface_of(*problem, size=1e-3).moved(problem[2], False)
