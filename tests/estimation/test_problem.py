"""Columns and gradients against differences, what is integrated out against SciPy's distributions, noise as drawn."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_matrix
from scipy.stats import multivariate_normal
from synthetic import GREY, WHITE, beads, block, lid, scale, truth

from warpbrain.errors import InputError
from warpbrain.estimation.finer_mesh import NAMES, Discretisation, FinerMesh, discretisation_error
from warpbrain.estimation.forward import Forward
from warpbrain.estimation.likelihood import Likelihood, Noise, typical_size
from warpbrain.estimation.observations import Observations, Sensors
from warpbrain.estimation.parameters import Gaussian, PriorMode
from warpbrain.estimation.problem import Nuisances, Point, Problem
from warpbrain.inference.noise import outliers
from warpbrain.mesh import TetMesh
from warpbrain.physics.mechanisms.asymmetry import Asymmetry
from warpbrain.recordings.base import Registration
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
    error = discretisation_error([FinerMesh("cpu")], forward, state, forward.differentiate(state))
    mode = PriorMode(
        1.0, Gaussian(np.log([1000.0, 900.0]), np.diag([0.5, 0.6])), np.full(2, -np.inf), np.full(2, np.inf)
    )
    nuisances = Nuisances(Discretisation(), error, Registration(0.001, 0.0175))
    return Problem(forward, Observations.to_fit(case), mode, Likelihood(), nuisances)


SHAPE = 0.1 * np.random.default_rng(5).normal(size=len(NAMES) - 1)
VALUES = np.array([1.2, *SHAPE, 1e-4, -2e-4, 5e-5, 0.03, 0.08, -0.05])


@pytest.fixture(scope="module")
def point(problem: Problem) -> Point:
    """Beside the tissue that the error of the mesh was computed at, with the noise that is likely there."""
    state = problem.forward.solve(THETA + np.array([0.1, -0.05]))
    noise = problem.likely_noise(state, VALUES, problem.forward.differentiate(state))
    return problem.at(state, VALUES, noise)


def test_columns_are_differences_of_what_is_seen(problem: Problem, point: Point) -> None:
    theta = point.state.theta
    columns = problem.columns(point.rows, theta, VALUES, problem.forward.differentiate(point.state))
    columns[:, :2] = columns[:, :2] @ np.linalg.inv(problem.mode.gaussian.factor)
    columns[:, 2:] /= problem.nuisances.prior.standard_deviations
    steps = np.array([*[1e-3] * (2 + len(NAMES)), *[1e-6] * 3, *[1e-5] * 3])
    for k, step in enumerate(steps):
        sides = []
        for sign in (1.0, -1.0):
            there = np.concatenate([theta, VALUES]) + sign * step * np.eye(len(steps))[k]
            state = problem.forward.solve(there[:2]) if k < 2 else point.state
            sides.append(problem.seen(state, there[2:]).residual)
        expected = -(sides[0] - sides[1]) / (2.0 * step)
        # of surfaces the closest point moves along the surface
        assert np.linalg.norm(columns[:, k] - expected) < 1e-3 * np.linalg.norm(expected)


def test_nuisances_are_integrated_out_of_the_objective_and_of_its_gradient(problem: Problem, point: Point) -> None:
    # the same by a covariance of all that is not known, as SciPy has it
    covariance = point.noise.model.noise_covariance + point.model.columns @ point.model.columns.T
    expected = -multivariate_normal(np.zeros(len(covariance)), covariance).logpdf(point.residual)
    assert point.misfit == pytest.approx(expected - point.noise.log_prior)
    linearised, prior = problem.linearise(point), problem.mode.gaussian
    J, r = (point.model.standardised(rows) for rows in (linearised.columns, point.residual))
    gradient = prior.precision @ (point.state.theta - prior.mean) - J.T @ r
    for k in range(2):
        ends = [point.state.theta + step * np.eye(2)[k] for step in (1e-3, -1e-3)]
        about = point.nuisances, point.noise, point.model
        sides = [problem.at(problem.forward.solve(end), *about).objective for end in ends]
        assert gradient[k] == pytest.approx((sides[0] - sides[1]) / 2e-3, rel=1e-4, abs=1e-3)


def test_nuisances_are_linear_about_their_best_values_wherever_these_are_sought_from(problem: Problem, point) -> None:
    best, other = (
        problem.at_best(problem.at(point.state, values, point.noise))
        for values in (VALUES, problem.nuisances.prior.mean)
    )
    assert other.misfit == pytest.approx(best.misfit, abs=1e-3)
    # what is left and the prior pull alike: no values are more probable
    xi = (best.nuisances - problem.nuisances.prior.mean) / problem.nuisances.prior.standard_deviations
    white = best.noise.model.whitened(np.column_stack([best.rows.residual, best.model.columns]))
    np.testing.assert_allclose(white[:, 1:].T @ white[:, 0], xi, atol=1e-4 * (1.0 + np.abs(xi).max()))


def rows_of(where: np.ndarray, sigma: float) -> Sensors:
    """Points (n, 3) [m], each thrice, whose three components were recorded, and nothing else of them."""
    n = len(where)
    columns, zero = csr_matrix((n, 0)), np.zeros(n, dtype=int)
    each = {"residual": np.zeros(n), "computed": np.zeros(n), "by_displacement": columns, "by_reactions": columns}
    along, where_of = np.tile(np.eye(3), (n // 3, 1)), {"groups": np.arange(n) // 3, "recordings": zero}
    of_points = {"rigid": np.zeros((n, 6)), "positions": where, "directions": along, "over_element": np.zeros((n, 3))}
    when = {"times": np.full(n, np.inf), "after": zero, "before": zero - 1, "references": np.zeros(n)}
    return Sensors(**each, **of_points, **where_of, **when, sigma=np.full(n, sigma), names=("points",), radius=0.065)


def test_noise_and_gross_errors_are_found_as_they_were_drawn(verify) -> None:
    """Rows drawn from the likelihood itself, without anything to estimate."""
    random = np.random.default_rng(0)
    where = np.repeat(random.uniform(0.0, 0.1, (150, 3)), 3, axis=0)
    rows = rows_of(where, 5e-4)
    np.testing.assert_array_equal(rows.points, np.arange(450).reshape(150, 3))
    wrong = np.zeros(150, dtype=bool)
    wrong[:8] = True
    drawn = replace(Noise.of(rows, rows.sigma, 0.0, outliers(), 1.5), inflation=np.where(wrong, 8.0, 1.0))
    covariance = drawn.model.noise_covariance
    residual = np.linalg.cholesky(covariance) @ random.normal(size=450)
    found = Likelihood().noise(rows, residual, np.zeros((450, 0)))
    assert not (found.gross & ~wrong).any() and found.gross.sum() >= 6
    verify(
        "factor on the noise of 450 recorded numbers, 8 of 150 points gross errors",
        "factor with which they were drawn",
        abs(found.scale / 1.5 - 1.0),
        0.1,
    )
    expected = multivariate_normal(np.zeros(450), covariance).logpdf(residual) + drawn.log_prior
    assert drawn.log_evidence(residual, np.zeros((450, 0))) == pytest.approx(expected)
    undeclared = rows_of(where, np.nan)
    found = Likelihood().noise(undeclared, residual, np.zeros((450, 0)))
    verify(
        "standard deviation of a noise that is not declared, 8 of 150 points gross errors",
        "standard deviation with which they were drawn",
        abs(found.sigma[0] / 7.5e-4 - 1.0),
        0.1,
    )


def test_no_point_is_a_gross_error_where_there_are_none() -> None:
    rows = rows_of(np.zeros((3, 3)), 1e-3)
    residual = np.full(3, 1.0)
    assert Likelihood().noise(rows, residual, np.zeros((3, 0))).gross.all()
    assert not Likelihood(None).noise(rows, residual, np.zeros((3, 0))).gross.any()


def test_points_are_located_anew_where_they_or_the_mesh_are_others() -> None:
    case = block({"white": WHITE}, "pushed")
    mesh, seen = case.mesh, beads(truth(case), sigma=3e-4)
    moved = replace(seen, points=seen.points * 0.9)
    larger = replace(case, mesh=TetMesh(1.1 * mesh.points, mesh.tetrahedra, mesh.tissue, mesh.node_sets))
    u = case.mesh.points**2
    for there, recording in ((case, seen), (case, moved), (larger, seen)):
        rows = Observations.to_fit(replace(there, recordings=(recording,))).at(u, np.zeros_like(u))
        expected = locate(there.mesh.points, there.mesh.tetrahedra, recording.points).interpolate(u)
        np.testing.assert_allclose(rows.residual.reshape(-1, 3), recording.displacement - expected, atol=1e-15)


def test_a_mechanism_that_says_the_law_is_refused() -> None:
    case = block({"grey": GREY, "white": WHITE}, "moved")
    with pytest.raises(InputError, match="'asymmetry': says what law tissues have"):
        Forward(replace(case, mechanisms=(*case.mechanisms, Asymmetry(exponent=-5.0))), THETA, "cpu")


def test_the_size_of_noise_is_the_same_in_any_axes():
    """Few gross errors do not matter, and of one number for each point it is the median deviation."""
    rng = np.random.default_rng(0)
    vectors = 3.0 * rng.normal(size=(2000, 3))
    vectors[:100] *= 50.0
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    sizes = [typical_size((vectors @ turn.T).ravel(), np.repeat(np.arange(2000), 3)) for turn in (np.eye(3), R)]
    assert sizes[1] == pytest.approx(sizes[0], rel=1e-12) and sizes[0] == pytest.approx(3.0, rel=0.05)
    numbers = vectors[:, 0]
    deviation = 1.4826 * np.median(np.abs(numbers))
    assert typical_size(numbers, np.arange(2000)) == pytest.approx(deviation, rel=1e-4)
