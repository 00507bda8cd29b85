"""The Gaussian model against SciPy's multivariate normal and the law of its own draws."""

import numpy as np
import pytest
from drawn_rows import draws
from scipy import stats

from warpbrain.inference import GaussianModel

RANDOM = np.random.default_rng(5)
N, Q = 23, 7


def model(scale: float = 1.3) -> GaussianModel:
    noise = RANDOM.normal(size=(N, N)) / 6.0 + np.eye(N)
    return GaussianModel(np.linalg.cholesky(noise @ noise.T), RANDOM.normal(size=(N, Q)), scale)


@pytest.mark.parametrize("scale", [0.4, 1.0, 3.0])
def test_log_density_is_that_of_a_multivariate_normal(scale: float) -> None:
    one = model(scale)
    rows = RANDOM.normal(size=(N, 4))
    expected = stats.multivariate_normal(np.zeros(N), one.covariance).logpdf(rows.T)
    np.testing.assert_allclose(one.log_density(rows), expected, rtol=1e-11)
    np.testing.assert_allclose(
        one.with_scale(2.0).log_density(rows), model_with(one, 2.0).log_density(rows), rtol=1e-12
    )


def model_with(one: GaussianModel, scale: float) -> GaussianModel:
    return GaussianModel(one.noise_factor, one.columns, scale)


def test_products_of_standardised_rows_are_those_with_the_inverse_covariance() -> None:
    one = model()
    rows = RANDOM.normal(size=(N, 3))
    white = one.standardised(rows)
    np.testing.assert_allclose(white.T @ white, rows.T @ np.linalg.solve(one.covariance, rows), rtol=1e-10)


def test_coefficients_are_those_of_bayesian_least_squares() -> None:
    one = model()
    rows = RANDOM.normal(size=N)
    mean, covariance = one.coefficients(rows)
    joint = np.linalg.solve(one.covariance, rows)
    np.testing.assert_allclose(mean, one.columns.T @ joint, rtol=1e-9, atol=1e-12)
    expected = np.eye(Q) - one.columns.T @ np.linalg.solve(one.covariance, one.columns)
    np.testing.assert_allclose(covariance, expected, atol=1e-12)


def test_draws_have_the_covariance() -> None:
    one = model()
    squares = np.sum(one.standardised(draws(one, 4000, np.random.default_rng(1))) ** 2, axis=0)
    assert stats.kstest(squares, stats.chi2(N).cdf).pvalue > 1e-3


def test_standardised_at_several_scales_is_as_at_each() -> None:
    rng = np.random.default_rng(3)
    factor = np.tril(rng.normal(size=(9, 9))) + 4.0 * np.eye(9)
    model = GaussianModel(factor, rng.normal(size=(9, 3)))
    rows, scales = rng.normal(size=(9, 4)), [0.5, 1.0, 3.0]
    for scale in scales:
        found = model.white(rows).standardised(scale).T
        assert np.allclose(found, GaussianModel(factor, model.columns, scale).standardised(rows), rtol=0.0, atol=1e-12)


def test_a_column_of_any_length_leaves_the_others_their_digits() -> None:
    """Where it is much longer than the noise ten times the length is ten times less density, and nothing else."""
    columns, rows = RANDOM.normal(size=(N, Q)), RANDOM.normal(size=N)
    noise = model().noise_factor
    long, longer = (GaussianModel(noise, columns * np.r_[length, np.ones(Q - 1)]) for length in (1e4, 1e11))
    assert float(long.log_density(rows) - longer.log_density(rows)) == pytest.approx(np.log(1e7), abs=1e-6)
    (mean, covariance), (same_mean, same_covariance) = long.coefficients(rows), longer.coefficients(rows)
    np.testing.assert_allclose(same_mean[1:], mean[1:], atol=1e-6)
    np.testing.assert_allclose(same_covariance[1:, 1:], covariance[1:, 1:], atol=1e-6)
    blocks = np.arange(N - 2).reshape(-1, 3)
    np.testing.assert_allclose(longer.precision_blocks(blocks), long.precision_blocks(blocks), atol=1e-6)
