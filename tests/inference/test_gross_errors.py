"""Gross errors against the sum over all indicators written out."""

from itertools import product

import numpy as np
import pytest
from scipy import stats
from scipy.special import logsumexp

from warpbrain.inference.gaussian import GaussianModel
from warpbrain.inference.gross_errors import Outliers, with_gross_errors

PRIOR = Outliers(0.03, 15.0)
POINTS = [np.arange(3 * k, 3 * k + 3) for k in range(6)]


def model(random: np.random.Generator) -> GaussianModel:
    shared = np.exp(-0.3 * np.abs(np.subtract.outer(np.arange(18), np.arange(18))))
    noise = np.linalg.cholesky(0.3 * shared + np.eye(18))
    return GaussianModel(noise, random.normal(size=(18, 2)), 1.1)


def sum_written_out(one: GaussianModel, residual: np.ndarray) -> tuple[float, np.ndarray]:
    noise = one.scale**2 * one.noise_factor @ one.noise_factor.T
    logs, each = [], []
    for gross in product([False, True], repeat=len(POINTS)):
        covariance = one.covariance.copy()
        for rows, there in zip(POINTS, gross, strict=True):
            covariance[np.ix_(rows, rows)] += there * (PRIOR.inflation**2 - 1.0) * noise[np.ix_(rows, rows)]
        log_prior = np.where(gross, np.log(PRIOR.probability), np.log1p(-PRIOR.probability)).sum()
        logs.append(stats.multivariate_normal(np.zeros(18), covariance).logpdf(residual) + log_prior)
        each.append(gross)
    total = logsumexp(logs)
    return float(total), np.exp(np.array(logs) - total) @ np.array(each, dtype=float)


@pytest.mark.parametrize("bad", [(), (2,), (0, 4)])
def test_density_and_odds_are_those_of_the_sum_written_out(bad: tuple[int, ...]) -> None:
    random = np.random.default_rng(len(bad))
    one = model(random)
    residual = one.draws(1, random)[:, 0]
    for point in bad:
        residual[POINTS[point]] += 15.0 * random.normal(size=3)
    found = with_gross_errors(one, residual, POINTS, PRIOR)
    log_density, probability = sum_written_out(one, residual)
    assert found.log_density == pytest.approx(log_density, abs=1e-6)
    np.testing.assert_allclose(1.0 / (1.0 + np.exp(-found.log_odds)), probability, atol=1e-6)
    assert set(np.flatnonzero(found.log_odds > 0.0).tolist()) == set(bad)


def test_what_a_cause_explains_is_no_gross_error() -> None:
    """A strong local cause moves two neighbours: errors under no cause, sound where it is among the columns."""
    random = np.random.default_rng(3)
    one = model(random)
    columns = np.zeros((18, 3))
    columns[3:6], columns[6:9] = np.eye(3), 0.8 * np.eye(3)
    residual = one.draws(1, random)[:, 0] + columns @ [20.0, -14.0, 9.0]
    alone = with_gross_errors(one, residual, POINTS, PRIOR)
    together = with_gross_errors(one.with_columns(20.0 * columns), residual, POINTS, PRIOR)
    assert (alone.log_odds > 0.0).sum() == 2
    assert not (together.log_odds > 0.0).any()
    assert together.log_density > alone.log_density
