"""What is predicted of points that nothing was fitted to, beside the normal distribution that it should be."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from warpbrain.diagnosis.held_out import HeldOut, placebo

N, KAPPA = 30, 1.4


@pytest.fixture
def held_out() -> HeldOut:
    sensors = SimpleNamespace(is_displacement=np.ones(N, dtype=bool))
    sigma = np.random.default_rng(0).uniform(0.5, 1.5, N)
    return HeldOut(sensors, sigma, np.ones(N, dtype=bool), np.arange(N) // 6)


def test_a_block_is_as_probable_as_a_normal_distribution_says(held_out: HeldOut) -> None:
    rng = np.random.default_rng(1)
    columns, residual = rng.normal(size=(N, 4)), rng.normal(size=N)
    found = held_out.predict(residual, columns, KAPPA)
    S = KAPPA**2 * np.diag(held_out.sigma**2) + columns @ columns.T
    for number in range(5):
        own, rest = held_out.blocks == number, held_out.blocks != number
        toward = S[np.ix_(own, rest)] @ np.linalg.inv(S[np.ix_(rest, rest)])
        mean, spread = toward @ residual[rest], S[np.ix_(own, own)] - toward @ S[np.ix_(rest, own)]
        assert found.log_densities[number] == pytest.approx(multivariate_normal(mean, spread).logpdf(residual[own]))
        np.testing.assert_allclose(found.errors[own], residual[own] - mean)


def test_what_moves_a_few_points_far_is_a_gain_and_noise_is_none(held_out: HeldOut) -> None:
    rng = np.random.default_rng(2)
    few = np.zeros((N, 1))
    few[::7, 0] = 1.0
    noise = held_out.sigma * rng.normal(size=N)
    moved = noise + 6.0 * few[:, 0]
    wide, nothing = 5.0 * few, np.zeros((N, 0))
    gain, sure = held_out.predict(moved, wide).gain(held_out.predict(moved, nothing))
    assert gain > sure > 10.0
    gain, sure = held_out.predict(noise, wide).gain(held_out.predict(noise, nothing))
    assert sure <= gain < 1.0


def test_what_one_block_gains_is_not_sure(held_out: HeldOut) -> None:
    noise = held_out.sigma * np.random.default_rng(4).normal(size=N)
    one = np.where(held_out.blocks == 2, 6.0, 0.0)[:, None]
    moved = noise + one[:, 0]
    gain, sure = held_out.predict(moved, one).gain(held_out.predict(moved, np.zeros((N, 0))))
    assert gain > 10.0
    assert sure < 0.1


def test_patterns_that_mean_nothing_do_not_predict(held_out: HeldOut) -> None:
    rng = np.random.default_rng(3)
    truth = rng.normal(size=(N, 1))
    residual = 5.0 * truth[:, 0] + held_out.sigma * rng.normal(size=N)
    patterns = placebo(held_out, residual, np.zeros((N, 0)), rng.normal(size=(N, 8)), 1, 2, 1.0, rng, count=40)
    true = held_out.predict(residual, 5.0 * truth)
    assert all(pattern.rmse > true.rmse and pattern.log_density < true.log_density for pattern in patterns)
