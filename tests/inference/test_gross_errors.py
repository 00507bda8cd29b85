"""Gross errors against the sum over all indicators written out."""

from itertools import product

import numpy as np
import pytest
from drawn_rows import draws
from scipy import stats
from scipy.special import logsumexp

from warpbrain.inference.gaussian import GaussianModel
from warpbrain.inference.gross_errors import (
    PointNoise,
    PointRows,
    _Search,
    columns_of_inflation,
    log_densities_of,
    with_gross_errors,
)
from warpbrain.inference.noise import Outliers, outliers

PRIOR = Outliers(0.03, 15.0)
#: Two kinds of gross errors.
TWO = Outliers(0.03, 6.0, (60.0,))
POINTS = [np.arange(3 * k, 3 * k + 3) for k in range(6)]


def model(random: np.random.Generator) -> GaussianModel:
    shared = np.exp(-0.3 * np.abs(np.subtract.outer(np.arange(18), np.arange(18))))
    noise = np.linalg.cholesky(0.3 * shared + np.eye(18))
    return GaussianModel(noise, random.normal(size=(18, 2)), 1.1)


def sum_written_out(one: GaussianModel, residual: np.ndarray, prior: Outliers) -> tuple[float, set[int]]:
    """Log density of the rows, and points that are more probably gross errors than not."""
    noise = one.scale**2 * one.noise_factor @ one.noise_factor.T
    kinds = [(1.0, 1.0 - prior.probability)]
    kinds += [(w, prior.probability / (1 + len(prior.further))) for w in (prior.inflation, *prior.further)]
    logs, each = [], []
    for chosen in product(kinds, repeat=len(POINTS)):
        covariance = one.covariance.copy()
        for rows, (inflation, _) in zip(POINTS, chosen, strict=True):
            covariance[np.ix_(rows, rows)] += (inflation**2 - 1.0) * noise[np.ix_(rows, rows)]
        log_prior = sum(np.log(probability) for _, probability in chosen)
        square = residual @ np.linalg.solve(covariance, residual)
        logs.append(-0.5 * (square + np.linalg.slogdet(2.0 * np.pi * covariance)[1]) + log_prior)
        each.append([inflation > 1.0 for inflation, _ in chosen])
    total = logsumexp(logs)
    probabilities = np.exp(np.array(logs) - total) @ np.array(each, dtype=float)
    return float(total), set(np.flatnonzero(probabilities > 0.5).tolist())


@pytest.mark.parametrize("prior", [PRIOR, TWO])
@pytest.mark.parametrize("bad", [(), (2,), (0, 4)])
def test_density_and_gross_errors_are_those_of_the_sum_written_out(bad: tuple[int, ...], prior: Outliers) -> None:
    random = np.random.default_rng(len(bad))
    one = model(random)
    residual = draws(one, 1, random)[:, 0]
    for point in bad:
        residual[POINTS[point]] += 40.0 * random.normal(size=3)
    found = with_gross_errors(one, residual, POINTS, prior)
    log_density, probable = sum_written_out(one, residual, prior)
    assert found.log_density == pytest.approx(log_density, abs=1e-3 if prior is TWO else 1e-6)
    assert set(np.flatnonzero(found.inflation > 1.0).tolist()) == probable == set(bad)


def test_a_point_that_is_far_away_pulls_no_more() -> None:
    """A mean of all points, one of which is a hundred standard deviations off: as good as without it."""
    random = np.random.default_rng(6)
    one = GaussianModel(np.eye(30), np.tile(np.eye(3), (10, 1)))
    points = [np.arange(3 * k, 3 * k + 3) for k in range(10)]
    residual = random.normal(size=30)
    without = residual[3:].reshape(-1, 3).mean(axis=0)
    residual[:3] += 100.0
    away = []
    for prior in (PRIOR, TWO):
        inflation = with_gross_errors(one, residual, points, prior).inflation
        assert inflation[0] == prior.inflations[-1] and (inflation[1:] == 1.0).all()
        mean, _ = one.with_columns(columns_of_inflation(one, points, inflation)).coefficients(residual)
        away.append(np.abs(mean[:3] - 0.9 * without).max())
    assert away[1] < 0.1 * away[0] and away[1] < 0.05


def test_what_a_cause_explains_is_no_gross_error() -> None:
    """A strong local cause moves two neighbours: errors under no cause, sound where it is among the columns."""
    random = np.random.default_rng(3)
    one = model(random)
    columns = np.zeros((18, 3))
    columns[3:6], columns[6:9] = np.eye(3), 0.8 * np.eye(3)
    residual = draws(one, 1, random)[:, 0] + columns @ [20.0, -14.0, 9.0]
    alone = with_gross_errors(one, residual, POINTS, PRIOR)
    together = with_gross_errors(one.with_columns(20.0 * columns), residual, POINTS, PRIOR)
    assert (alone.inflation > 1.0).sum() == 2
    assert (together.inflation == 1.0).all()
    assert together.log_density > alone.log_density


def test_points_of_three_rows_and_of_one_against_covariances_written_out() -> None:
    """Many flips, points of surfaces beside tracked ones, against dense normal log densities."""
    random = np.random.default_rng(5)
    points = [np.arange(3 * k, 3 * k + 3) for k in range(12)] + [np.array([36 + k]) for k in range(14)]
    noise = np.linalg.cholesky(
        0.2 * np.exp(-0.2 * np.abs(np.subtract.outer(np.arange(50), np.arange(50)))) + np.eye(50)
    )
    one = GaussianModel(noise, random.normal(size=(50, 6)), 0.9)
    residual = draws(one, 1, random)[:, 0]
    for point in random.choice(26, 9, replace=False).tolist():
        residual[points[point]] += 12.0 * random.normal(size=len(points[point]))
    found = with_gross_errors(one, residual, points, PRIOR)
    gross = found.inflation > 1.0
    assert gross.sum() > 4

    def log_density(which: np.ndarray) -> float:
        covariance = one.covariance.copy()
        for rows in (points[k] for k in np.flatnonzero(which)):
            of_noise = one.scale**2 * (one.noise_factor @ one.noise_factor.T)[np.ix_(rows, rows)]
            covariance[np.ix_(rows, rows)] += (PRIOR.inflation**2 - 1.0) * of_noise
        prior = np.where(which, np.log(PRIOR.probability), np.log1p(-PRIOR.probability)).sum()
        return float(stats.multivariate_normal(np.zeros(50), covariance).logpdf(residual) + prior)

    # none alone is more probable otherwise; how probable that is adds to the density
    here, sums = log_density(gross), 0.0
    for point in range(26):
        other = gross.copy()
        other[point] = ~gross[point]
        there = log_density(other)
        assert there < here
        sums += np.logaddexp(0.0, there - here)
    assert found.log_density == pytest.approx(here + sums, abs=1e-8)
    wider = one.with_columns(columns_of_inflation(one, points, found.inflation))
    prior = np.where(gross, np.log(PRIOR.probability), np.log1p(-PRIOR.probability)).sum()
    assert float(wider.log_density(residual)) + prior == pytest.approx(here, abs=1e-8)


@pytest.mark.parametrize("prior", [PRIOR, TWO])
def test_begun_with_gross_errors_of_a_similar_hypothesis_it_ends_at_the_same(prior: Outliers) -> None:
    random = np.random.default_rng(11)
    one = model(random)
    residual = draws(one, 1, random)[:, 0]
    residual[POINTS[1]] += 40.0 * random.normal(size=3)
    cold = with_gross_errors(one, residual, POINTS, prior)
    for sound in (cold.inflation, np.where(np.arange(6) == 3, prior.inflation, 1.0)):
        warm = PointRows(one, residual, PointNoise(one, POINTS)).with_gross_errors(prior, sound)
        np.testing.assert_array_equal(warm.inflation, cold.inflation)
        assert warm.log_density == pytest.approx(cold.log_density, abs=1e-9)


def test_several_causes_are_weighed_as_each_by_itself() -> None:
    random = np.random.default_rng(12)
    one = model(random)
    residual = draws(one, 1, random)[:, 0]
    residual[POINTS[1]] += 40.0 * random.normal(size=3)
    tried = [(random.normal(size=18), random.normal(size=(18, count))) for count in (1, 3)]
    found = log_densities_of(one, residual, POINTS, tried)
    for (mean, columns), log_density in zip(tried, found, strict=True):
        alone = with_gross_errors(one.with_columns(columns), residual - mean, POINTS, outliers())
        assert log_density == pytest.approx(alone.log_density, rel=1e-9)


def test_a_point_with_less_inflation_again_is_as_if_it_had_had_no_more() -> None:
    random = np.random.default_rng(11)
    one = model(random)
    rows = PointRows(one, 5.0 * draws(one, 1, random)[:, 0], PointNoise(one, POINTS))
    back, at_once = (_Search(rows, TWO, None, 1.0) for _ in range(2))
    for point, kind in ((2, 2), (4, 1), (5, 1), (2, 1), (5, 0)):
        back.change(point, kind)
    at_once.begin_with(np.array([0, 0, 1, 0, 1, 0]))
    assert back.log_density == pytest.approx(at_once.log_density, abs=1e-9)
    assert back.weighted == pytest.approx(at_once.weighted, abs=1e-9)
    assert back.log_ratios() == pytest.approx(at_once.log_ratios(), abs=1e-7)
