"""Evidence that rests on a single point."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from warpbrain.diagnosis.evidence import Explanation
from warpbrain.diagnosis.single_points import log_evidence_and_odds, log_odds
from warpbrain.worlds.body.sensors import Sensors

POINTS = 12


def sensors_of(groups):
    n = len(groups)
    nothing = np.zeros((n, 1))
    rest = (nothing, nothing, np.zeros((n, 6)), np.ones(n), np.zeros((n, 3)), np.ones((n, 3)))
    return Sensors(np.zeros(n), np.zeros(n), *rest, np.asarray(groups), np.zeros(n, int), np.zeros(n), ("points",))


@pytest.fixture
def model():
    random = np.random.default_rng(3)
    groups = np.concatenate([np.repeat(np.arange(POINTS), 3), POINTS + np.arange(5)])
    n = len(groups)
    factor = np.linalg.cholesky(0.3 * np.eye(n) + 0.05)
    return sensors_of(groups), factor, random.normal(size=(n, 4)), random


def noise_of(model):
    sensors, factor, columns, random = model
    return factor @ random.normal(size=len(sensors)) + columns @ random.normal(size=4)


def log_gross(sensors, factor, columns, residual):
    """What the evidence gains where the factor on the noise is known to be one."""
    explanation = Explanation(factor, columns)
    white = explanation.whitened(residual)[:, None]
    found, _ = log_evidence_and_odds(sensors, explanation, residual, np.ones(1))
    return found - float(explanation.log_none(white, np.ones(1))[0, 0])


def test_hardly_anything_is_gained_where_no_point_stands_out(model):
    sensors, factor, columns, _ = model
    assert 0.0 < log_gross(sensors, factor, columns, noise_of(model)) < 1.0


def test_one_point_that_stands_out_costs_no_more_than_a_gross_error(model):
    sensors, factor, columns, _ = model
    residual = noise_of(model)
    rows = np.flatnonzero(sensors.groups == 4)
    error = np.zeros(len(residual))
    error[rows] = [4.0, -3.0, 2.0]
    explains = np.column_stack([columns, 10.0 * error])

    def evidence(U, r):
        return multivariate_normal(np.zeros(len(r)), factor @ factor.T + U @ U.T).logpdf(r)

    off = residual + error
    raw = evidence(explains, off) - evidence(columns, off)
    fair = raw + log_gross(sensors, factor, explains, off) - log_gross(sensors, factor, columns, off)
    # a column made for that very point explains it all; a gross error does nearly as well
    assert raw > 20.0
    assert fair < 7.0


def test_what_many_points_say_stays_evidence(model):
    sensors, factor, columns, random = model
    effect = random.normal(size=len(sensors))
    residual = noise_of(model) + 1.5 * effect
    explains = np.column_stack([columns, 2.0 * effect])

    def fair(U):
        evidence = multivariate_normal(np.zeros(len(residual)), factor @ factor.T + U @ U.T).logpdf(residual)
        return evidence + log_gross(sensors, factor, U, residual)

    assert fair(explains) - fair(columns) > 10.0


def test_of_one_point_it_is_the_mixture(model):
    # without nuisances and correlation nothing is to first order
    sensors, residual = sensors_of([0, 0, 0, 1, 1, 1]), np.array([9.0, 1.0, -2.0, 0.3, 0.1, 0.0])
    found = log_gross(sensors, np.eye(6), np.zeros((6, 1)), residual)
    narrow, wide = multivariate_normal(np.zeros(3), np.eye(3)), multivariate_normal(np.zeros(3), 64.0 * np.eye(3))
    exact = sum(np.log1p(0.03 * wide.pdf(r) / narrow.pdf(r)) for r in (residual[:3], residual[3:]))
    assert found == pytest.approx(exact, rel=1e-9)


def test_odds_are_of_the_point_that_stands_out(model):
    sensors, factor, columns, _ = model
    residual = noise_of(model)
    residual[sensors.groups == 4] += [4.0, -3.0, 2.0]
    likely = log_odds(sensors, Explanation(factor, columns), residual, 1.0) > 0.0
    np.testing.assert_array_equal(likely, sensors.groups == 4)


def test_a_gross_error_does_not_make_the_noise_of_all_others_large(model):
    sensors, factor, columns, random = model
    factor = 0.7 * factor
    residual = factor @ random.normal(size=len(sensors)) + columns @ random.normal(size=4)
    error = np.zeros(len(residual))
    error[sensors.groups == 4] = [14.0, -9.0, 6.0]
    off = residual + error

    def evidence(U):
        return log_evidence_and_odds(sensors, Explanation(factor / 0.7, U), off)[0]

    def at_its_own_noise(U):
        explanation = Explanation(factor / 0.7, U)
        plain = float(explanation.log_marginal(explanation.whitened(off)[:, None])[0])
        kappa = explanation.best_kappa(explanation.whitened(off))
        odds = log_odds(sensors, explanation, off, kappa)[np.unique(sensors.groups, return_index=True)[1]]
        return plain + float(np.logaddexp(0.0, odds).sum())

    explains = np.column_stack([columns, 20.0 * error])
    # what was done before this test: the noise first, then the odds
    assert at_its_own_noise(explains) - at_its_own_noise(columns) > evidence(explains) - evidence(columns) + 3.0
    assert evidence(explains) - evidence(columns) < 15.0


def test_inverse_and_its_blocks_are_those_of_the_covariance(model):
    sensors, factor, columns, random = model
    residual, kappa = random.normal(size=len(sensors)), 1.3
    inverse = np.linalg.inv(kappa**2 * factor @ factor.T + columns @ columns.T)
    explanation = Explanation(factor, columns)
    np.testing.assert_allclose(explanation.inverse_times(residual, kappa), inverse @ residual, rtol=1e-8, atol=1e-10)
    rows = np.arange(3 * POINTS).reshape(-1, 3)
    blocks = inverse[rows[:, :, None], rows[:, None, :]]
    np.testing.assert_allclose(explanation.inverse_blocks(rows, kappa), blocks, rtol=1e-8, atol=1e-10)


def test_a_large_noise_is_no_crowd_of_gross_errors(model):
    sensors, factor, _, random = model
    # with nuisances that explain half of it, of which each point is compared with all others as if these were sound
    columns = 10.0 * random.normal(size=(len(sensors), len(sensors) // 2))
    residual = 3.3 * factor @ random.normal(size=len(sensors)) + columns @ random.normal(size=columns.shape[1])
    explanation = Explanation(factor, columns)
    found, odds = log_evidence_and_odds(sensors, explanation, residual)
    first = np.unique(sensors.groups, return_index=True)[1]
    assert np.mean(odds[first] > 0.0) < 0.25
    # the noise is as large as it is without gross errors
    plain = float(explanation.log_marginal(explanation.whitened(residual)[:, None])[0])
    assert plain - 1.0 < found < plain + 2.0
