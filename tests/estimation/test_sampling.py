"""Weighted draws and chains on distributions that are known."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import genpareto

from warpbrain.estimation.parameters import Gaussian
from warpbrain.estimation.sampling import (
    Proposal,
    effective_size,
    generalised_pareto,
    importance_sampling,
    pareto_smoothed,
    run_chain,
)

MEAN, DEVIATION = np.array([1.0, -2.0]), np.array([0.5, 0.1])


@pytest.mark.parametrize("k", [-0.3, 0.1, 0.5, 0.9])
def test_the_shape_of_a_pareto_tail(k: float) -> None:
    x = np.sort(genpareto.rvs(k, scale=2.0, size=5000, random_state=1))
    found, sigma = generalised_pareto(x)
    # Monte Carlo error of 5,000 draws: at most (1 + k) / sqrt(5000) = 0.027 and 2.8 %; 0.028 and 1.6 % off
    assert found == pytest.approx(k, abs=0.04) and sigma == pytest.approx(2.0, rel=0.03)


def test_weights_that_are_alike_are_trusted_and_one_that_is_all_is_not() -> None:
    assert pareto_smoothed(np.zeros(64)).k == 0.0
    assert pareto_smoothed(np.zeros(64)).effective == pytest.approx(64.0)
    wild = pareto_smoothed(8.0 * np.random.default_rng(0).normal(size=64))
    assert wild.k > 0.7
    assert pareto_smoothed(np.full(64, -np.inf)).k == np.inf


class Known:
    """A normal distribution in the place of a posterior; the first stage of the chain sees a wrong one."""

    unstable = failed = 0

    def log_density(self, theta: np.ndarray) -> float:
        return -0.5 * float(np.sum(((theta - MEAN) / DEVIATION) ** 2))

    def linearised(self, theta: np.ndarray) -> float:
        return -0.5 * float(np.sum(((theta - MEAN - 0.3 * DEVIATION) / (1.2 * DEVIATION)) ** 2))


@pytest.fixture
def proposal() -> Proposal:
    def mode(mean: np.ndarray, times: float) -> SimpleNamespace:
        prior = SimpleNamespace(low=np.full(2, -np.inf), high=np.full(2, np.inf), share=0.5)
        laplace = SimpleNamespace(posterior=Gaussian(mean, np.diag((times * DEVIATION) ** 2)))
        return SimpleNamespace(theta=mean, problem=SimpleNamespace(mode=prior), laplace=laplace, log_evidence=0.0)

    return Proposal((mode(MEAN + 0.2 * DEVIATION, 0.9), mode(MEAN - 0.5 * DEVIATION, 1.3)))


def test_weighted_draws_have_the_moments_of_what_weighs_them(proposal: Proposal) -> None:
    found = importance_sampling(Known(), proposal, 4000, np.random.default_rng(0))
    assert found.smoothed.k < 0.5 and found.smoothed.effective > 2000
    # Monte Carlo error of 3,500 independent draws: 0.017 and 1.2 %; 0.012 and 0.9 % off
    np.testing.assert_allclose((found.mean - MEAN) / DEVIATION, 0.0, atol=0.025)
    np.testing.assert_allclose(found.standard_deviations, DEVIATION, rtol=0.02)


@pytest.mark.slow(2)
def test_a_chain_has_the_moments_of_its_target(proposal: Proposal) -> None:
    chain = run_chain(Known(), proposal, MEAN, 4000, np.random.default_rng(0))
    assert chain.solves == 4000 and chain.effective.min() > 500 and 0.3 < chain.accepted < 1.0
    # Monte Carlo error of 500 independent draws: 0.045 and 3.2 %; 0.034 and 4.5 % off
    np.testing.assert_allclose((chain.theta.mean(axis=0) - MEAN) / DEVIATION, 0.0, atol=0.06)
    np.testing.assert_allclose(chain.theta.std(axis=0), DEVIATION, rtol=0.06)


def test_independent_draws_of_a_chain() -> None:
    rng = np.random.default_rng(0)
    x = np.zeros(20_000)
    for k in range(1, len(x)):
        x[k] = 0.9 * x[k - 1] + rng.normal()
    # (1 - rho) / (1 + rho), of autocorrelations that are estimated from one chain: 10 % off
    assert effective_size(x) == pytest.approx(len(x) / 19.0, rel=0.15)
    assert effective_size(rng.normal(size=5000)) == pytest.approx(5000, rel=0.01)
    assert effective_size(np.ones(10)) == 1.0
