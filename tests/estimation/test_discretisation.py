"""The error of the mesh against a finer mesh that no estimation solved, and its derivatives against differences."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import GREY, WHITE, block, truth, with_laws

from warpbrain.errors import InputError
from warpbrain.estimation.finer_mesh import NAMES, Discretisation, DiscretisationError, FinerMesh, discretisation_error
from warpbrain.estimation.forward import Forward
from warpbrain.mesh.refinement import refined
from warpbrain.physics.laws import NeoHookean

THETA = np.log([1370.0, 1000.0])
CASE = block({"grey": GREY, "white": WHITE}, "gravity")


def error_at(case, theta: np.ndarray) -> DiscretisationError:
    forward = Forward(case, theta, "cpu")
    state = forward.solve(theta)
    return discretisation_error([FinerMesh("cpu")], forward, state, forward.differentiate(state))


@pytest.fixture(scope="module")
def error() -> DiscretisationError:
    return error_at(CASE, THETA)


def test_it_is_the_difference_of_two_meshes(error) -> None:
    plain, smaller = truth(CASE), truth(replace(CASE, mesh=refined(CASE.mesh)[0]))
    expected = smaller.u[: len(CASE.mesh.points)] - plain.u
    # solved to what is far below any noise
    np.testing.assert_allclose(error.change.u, expected, atol=1e-4 * np.abs(expected).max())
    total = smaller.reactions.sum(axis=0) - plain.reactions.sum(axis=0)
    atol = 1e-4 * np.abs(plain.reactions.sum(axis=0)).max()
    np.testing.assert_allclose(error.change.reactions.sum(axis=0), total, atol=atol)


def test_derivatives_by_tissue_are_differences_of_errors(error) -> None:
    step = 0.02
    values = np.array([1.2, *0.1 * np.random.default_rng(0).normal(size=len(NAMES) - 1)])
    for k, found in enumerate(error.by_theta(values)[0]):
        # each is to first order about its own parameters: its values there
        ends = [THETA + sign * step * np.eye(2)[k] for sign in (1.0, -1.0)]
        beside = [replace(error_at(CASE, end), part=error.part).at(end, values)[0] for end in ends]
        expected = (beside[0] - beside[1]) / (2.0 * step)
        assert np.linalg.norm(found - expected) < 1e-2 * np.linalg.norm(expected)


def test_amount_and_shape_act_as_their_matrices(error) -> None:
    rng = np.random.default_rng(1)
    values = rng.normal(size=len(NAMES))
    fields, forces = error.by_values(THETA, values)
    amount, slope = error.amount(values[0])
    linear = np.array([amount / slope, *values[1:]])
    u, reactions = error.at(THETA, values)
    np.testing.assert_allclose(u, np.tensordot(linear, fields, axes=1), rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(reactions, np.tensordot(linear, forces, axes=1), rtol=1e-12, atol=1e-12)
    # B_xy of the even part turns what is missing along y into x
    number = NAMES.index("shape of the mesh's error xy even")
    np.testing.assert_array_equal(fields[number], error.change.u[:, [1]] * [1.0, 0.0, 0.0])


def test_the_amount_is_that_of_an_error_of_the_stiffness(error) -> None:
    # stiffness too large by e, on elements of half the size by e / 2^p
    for p, e in ((1.0, 0.5), (2.0, 0.5), (1.5, 0.02)):
        u, smaller = 1.0 / (1.0 + e), 1.0 / (1.0 + e / 2.0**p)
        known = replace(error, part=(smaller - u) / smaller)
        assert known.amount(2.0**p / (2.0**p - 1.0))[0] == pytest.approx((1.0 - u) / (smaller - u))
    # without a singularity
    far = replace(error, part=0.3)
    for b in (1.0, 2.6, 2.7, 4.0):
        (low, _), (value, slope), (high, _) = (far.amount(b + step) for step in (-1e-6, 0.0, 1e-6))
        assert low < value < high and slope == pytest.approx((high - low) / 2e-6, rel=1e-4)


def test_a_shared_force_keeps_its_resultant_on_the_finer_mesh() -> None:
    case = with_laws(block({"brain": WHITE}, "pushed"), NeoHookean(1000.0))
    theta = np.log([1000.0])
    error, state = error_at(case, theta), Forward(case, theta, "cpu").solve(theta)
    total = (state.reactions + error.change.reactions).sum(axis=0)
    np.testing.assert_allclose(total, [-0.1, -0.05, 0.2], rtol=1e-4)


@pytest.mark.parametrize("values", [{"mean": np.inf}, {"deviation": 0.0}, {"shape": -1.0}])
def test_what_is_believed_is_checked(values) -> None:
    with pytest.raises(InputError, match="discretisation: "):
        Discretisation(**values)
