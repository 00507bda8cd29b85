"""Gradients of the objective against differences of it, and noise against SciPy's distributions."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_t, norm
from synthetic import GREY, WHITE, beads, block, lid, scale, truth

from warpbrain.errors import InputError
from warpbrain.estimation.discretisation import NAMES, Discretisation, FinerMesh
from warpbrain.estimation.forward import Forward
from warpbrain.estimation.gaussian import Gaussian
from warpbrain.estimation.likelihood import Likelihood, at_normal_noise
from warpbrain.estimation.nuisances import Nuisances
from warpbrain.estimation.observations import Observations
from warpbrain.estimation.prior_modes import PriorMode
from warpbrain.estimation.problem import Problem
from warpbrain.estimation.registration import Registration
from warpbrain.mesh import TetMesh
from warpbrain.physics.mechanisms.asymmetry import Asymmetry
from warpbrain.recordings.location import locate

THETA = np.log([1200.0, 1100.0])


@pytest.fixture(scope="module", params=["given", "estimated"])
def problem(request: pytest.FixtureRequest) -> Problem:
    """Points, a surface and a force of a moved block, with every nuisance."""
    case = block({"grey": GREY, "white": WHITE}, "moved")
    result = truth(case)
    sigma = 2e-4 if request.param == "given" else None
    recordings = (beads(result, noise=3e-4, sigma=sigma), lid(result, sigma=2e-4), scale(case, result, "plate", 1e-2))
    case = replace(case, recordings=recordings)
    forward = Forward(case, THETA, "cpu")
    state = forward.solve(THETA)
    derivatives = forward.differentiate(state)
    error = FinerMesh(case, THETA, "cpu").error(state, (derivatives.u, derivatives.reactions))
    mode = PriorMode(
        1.0, Gaussian(np.log([1000.0, 900.0]), np.diag([0.5, 0.6])), np.full(2, -np.inf), np.full(2, np.inf)
    )
    nuisances = Nuisances(Discretisation(), error, Registration())
    return Problem(forward, Observations.to_fit(case), mode, Likelihood(), nuisances)


SHAPE = 0.1 * np.random.default_rng(5).normal(size=len(NAMES) - 1)
VALUES = np.array([1.2, *SHAPE, 1e-4, -2e-4, 5e-5, 1e-3, 2e-3, -1e-3])


def test_the_gradient_is_that_of_the_objective(problem: Problem) -> None:
    def objective(point: np.ndarray) -> float:
        return problem.at(problem.forward.solve(point[:2]), point[2:]).objective

    # beside the tissue that the error of the mesh was computed at
    here = np.concatenate([THETA + np.array([0.1, -0.05]), VALUES])
    gradient = problem.linearise(problem.at(problem.forward.solve(here[:2]), VALUES)).gradient
    steps = np.array([*[1e-3] * (2 + len(NAMES)), *[1e-6] * 3, *[1e-5] * 3])
    for k, step in enumerate(steps):
        beside = [objective(here + sign * step * np.eye(len(here))[k]) for sign in (1.0, -1.0)]
        expected = (beside[0] - beside[1]) / (2.0 * step)
        scale_of = np.abs(gradient[k]) + 1e-6 * np.abs(gradient).max() / step
        assert abs(gradient[k] - expected) < 1e-4 * scale_of


def test_nuisances_are_at_their_best_and_integrated_out(problem: Problem) -> None:
    state = problem.forward.solve(THETA)
    misfit, best = problem.without_nuisances(state, problem.nuisances.mean)
    gradient = problem.linearise(best).gradient[2:]
    size = np.sqrt(np.diag(problem.linearise(best).hessian)[2:])
    assert np.abs(gradient / size).max() < 1e-4
    other, _ = problem.without_nuisances(state, VALUES)
    assert other == pytest.approx(misfit, abs=1e-3)


@pytest.mark.parametrize("nu", [4.0, np.inf])
def test_noise_is_the_distribution_that_it_is_said_to_be(nu: float) -> None:
    case = block({"white": WHITE}, "pushed")
    observations = Observations.to_fit(replace(case, recordings=(beads(truth(case), sigma=3e-4),)))
    residuals = 4e-4 * np.random.default_rng(0).normal(size=(40, 3))
    [weighed] = Likelihood(nu).weigh(observations.each, [residuals])
    if np.isinf(nu):
        expected = norm(0.0, 3e-4).logpdf(residuals).sum()
    else:
        scale = weighed.scale[0]
        assert scale == pytest.approx(0.8694 * 3e-4, rel=1e-3)
        expected = multivariate_t(np.zeros(3), scale**2 * np.eye(3), df=nu).logpdf(residuals).sum()
    assert weighed.negative_log == pytest.approx(-expected)


def test_the_estimated_noise_is_the_likeliest() -> None:
    case = block({"white": WHITE}, "pushed")
    seen = replace(case, recordings=(beads(truth(case), sigma=None),))
    residuals = 4e-4 * np.random.default_rng(0).normal(size=(40, 3))
    [weighed] = Likelihood().weigh(Observations.to_fit(seen).each, [residuals])
    for factor in (0.95, 1.05):
        given = replace(seen, recordings=(replace(seen.recordings[0], sigma=factor * weighed.sigma[0]),))
        [beside] = Likelihood().weigh(Observations.to_fit(given).each, [residuals])
        assert beside.negative_log > weighed.negative_log


def test_sigma_is_the_standard_deviation_of_normal_noise(verify) -> None:
    """Estimated of many rows with a few gross errors, whose number moves it little."""
    case = block({"white": WHITE}, "pushed")
    [one] = Observations.to_fit(replace(case, recordings=(beads(truth(case), sigma=None),))).each
    residuals = 3e-4 * np.random.default_rng(4).normal(size=(20000, 3))
    many = replace(one, rows=np.arange(20000), weights=np.ones(20000))
    [weighed] = Likelihood().weigh([many], [residuals])
    verify(
        "estimated noise, normal, is its standard deviation",
        "standard deviation of 60000 numbers that were drawn",
        abs(weighed.sigma[0] / 3e-4 - 1.0),
        0.01,
    )
    residuals[:400] *= 30.0
    [weighed] = Likelihood().weigh([many], [residuals])
    # one row of fifty is a gross error: 2.9 % off
    assert weighed.sigma[0] == pytest.approx(3e-4, rel=0.05)


@pytest.mark.parametrize("d", [1, 3])
def test_the_information_is_that_of_the_estimate_at_normal_noise(verify, d: int) -> None:
    """The location of 50 rows of normal noise of a given sigma, 4000 times: its scatter against what is stated."""
    nu, n, count = 4.0, 50, 4000
    scale, share = at_normal_noise(nu, d)
    rows = np.random.default_rng(d).normal(size=(count, n, d))
    location = rows.mean(axis=1)
    for _ in range(60):  # weighted means until they stand still: the likeliest location
        z2 = np.sum((rows - location[:, None]) ** 2, axis=2) / scale**2
        weights = (nu + d) / (nu + z2)
        location = np.einsum("cn,cnd->cd", weights, rows) / weights.sum(axis=1)[:, None]
    stated = np.sqrt(scale**2 / (share * weights.sum(axis=1)))
    verify(
        f"stated standard deviation of a location, {d} components a row",
        "scatter of 4000 estimates of normal noise (Monte Carlo error 1 %)",
        abs(float(np.mean((location / stated[:, None]) ** 2)) ** 0.5 - 1.0),
        0.04,
    )


def test_points_are_located_anew_where_they_or_the_mesh_are_others() -> None:
    case = block({"white": WHITE}, "pushed")
    mesh, seen = case.mesh, beads(truth(case), sigma=3e-4)
    moved = replace(seen, points=seen.points * 0.9)
    larger = replace(case, mesh=TetMesh(1.1 * mesh.points, mesh.tetrahedra, mesh.tissue, mesh.node_sets))
    u = case.mesh.points**2
    for there, recording in ((case, seen), (case, moved), (larger, seen)):
        [one] = Observations.to_fit(replace(there, recordings=(recording,))).each
        expected = locate(there.mesh.points, there.mesh.tetrahedra, recording.points).interpolate(u)
        values = one.at(u, np.zeros_like(u), np.zeros(3)).values
        np.testing.assert_allclose(values, recording.displacement - expected, atol=1e-15)


def test_degrees_of_freedom_are_positive() -> None:
    with pytest.raises(InputError, match="nu = 0: expected a positive number"):
        Likelihood(0.0)


def test_a_mechanism_that_says_the_law_is_refused() -> None:
    case = block({"grey": GREY, "white": WHITE}, "moved")
    with pytest.raises(InputError, match="'asymmetry': says what law tissues have"):
        Forward(replace(case, mechanisms=(*case.mechanisms, Asymmetry(exponent=-5.0))), THETA, "cpu")
