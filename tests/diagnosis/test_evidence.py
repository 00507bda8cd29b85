"""Evidence in closed form beside the density of a normal distribution, and what nuisances may not change."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.stats import kstest, multivariate_normal

from warpbrain.diagnosis.evidence import KAPPAS, Explanation, kappa_log_prior
from warpbrain.diagnosis.stack_evidence import StackEvidence
from warpbrain.worlds.body.effects import Effect

N = 40


@dataclass
class Example:
    noise: np.ndarray
    nuisances: np.ndarray
    effects: list[Effect]

    @property
    def explanation(self) -> Explanation:
        return Explanation(np.linalg.cholesky(self.noise), self.nuisances)


@pytest.fixture
def example() -> Example:
    rng = np.random.default_rng(1)
    root = rng.normal(size=(N, N))
    noise = 0.05 * root @ root.T + np.eye(N)
    effects = [Effect(None, rng.normal(size=N), rng.normal(size=(N, k))) for k in (1, 3, 1, 2)]
    return Example(noise, rng.normal(size=(N, 5)), effects)


@pytest.mark.parametrize("kappa", [0.7, 1.0, 2.0])
def test_it_is_the_density_of_a_normal_distribution(example: Example, kappa: float) -> None:
    rng = np.random.default_rng(2)
    residuals = rng.normal(size=(N, 3))
    explanation = example.explanation
    white = explanation.whitened(residuals)
    none = explanation.log_none(white, np.array([kappa]))[0]
    factors = StackEvidence(explanation, explanation.stack(example.effects)).log_factors(white, np.array([kappa]))[0]
    S = kappa**2 * example.noise + example.nuisances @ example.nuisances.T
    for b in range(3):
        assert none[b] == pytest.approx(multivariate_normal(np.zeros(N), S).logpdf(residuals[:, b]), rel=1e-9)
        for v, effect in enumerate(example.effects):
            whole = multivariate_normal(effect.mean, S + effect.columns @ effect.columns.T).logpdf(residuals[:, b])
            assert none[b] + factors[v, b] == pytest.approx(whole, rel=1e-9)


def test_coefficients_are_the_posterior_mean(example: Example) -> None:
    rng = np.random.default_rng(3)
    residual = rng.normal(size=(N, 1))
    explanation = example.explanation
    stack = explanation.stack(example.effects)
    S = example.noise + example.nuisances @ example.nuisances.T
    for v, effect in enumerate(example.effects):
        z, covariance = StackEvidence(explanation, stack).coefficients(explanation.whitened(residual)[:, 0], 1.0, v)
        precision = np.eye(effect.columns.shape[1]) + effect.columns.T @ np.linalg.solve(S, effect.columns)
        expected = np.linalg.solve(precision, effect.columns.T @ np.linalg.solve(S, residual[:, 0] - effect.mean))
        np.testing.assert_allclose(z, expected, rtol=1e-8)
        np.testing.assert_allclose(covariance, np.linalg.inv(precision), rtol=1e-8, atol=1e-12)


def test_what_a_nuisance_can_do_is_worth_nothing(example: Example) -> None:
    # a nuisance that may be anything, and residuals moved along it
    free = Explanation(np.linalg.cholesky(example.noise), 1e4 * example.nuisances)
    rng = np.random.default_rng(4)
    residual = rng.normal(size=(N, 1))
    moved = residual + example.nuisances @ rng.normal(size=(5, 1))
    evidence = StackEvidence(free, free.stack(example.effects))
    before, after = (evidence.log_factors(free.whitened(r)) for r in (residual, moved))
    np.testing.assert_allclose(after, before, atol=1e-3)


def test_p_values_of_draws_are_uniform(example: Example) -> None:
    explanation = example.explanation
    evidence = StackEvidence(explanation, explanation.stack(example.effects))

    def statistic(count: int, seed: int) -> np.ndarray:
        draws = explanation.draws(count, 1.0, np.random.default_rng(seed))
        weights = kappa_log_prior()[:, None, None]
        return np.asarray((evidence.log_factors(draws, KAPPAS) + weights).max(axis=(0, 1)))

    null, own = np.sort(statistic(2000, 5)), statistic(500, 6)
    p = 1.0 - np.searchsorted(null, own) / len(null)
    assert kstest(p, "uniform").pvalue > 0.01


def test_the_evidence_of_a_pair_is_that_of_quadrature() -> None:
    rng = np.random.default_rng(7)
    factor = np.linalg.cholesky(np.eye(6) + 0.1 * np.ones((6, 6)))
    first, second, residual = (rng.normal(size=(6, 1)) for _ in range(3))
    # the first is a nuisance where the second is looked for
    explanation = Explanation(factor, first)
    white = explanation.whitened(residual)
    stack = explanation.stack([Effect(None, np.zeros(6), second)])
    kappa = np.array([1.0])
    pair = (
        explanation.log_none(white, kappa)[0, 0] + StackEvidence(explanation, stack).log_factors(white, kappa)[0, 0, 0]
    )
    z = np.linspace(-8.0, 8.0, 321)
    a, b = (grid.ravel() for grid in np.meshgrid(z, z))
    left = np.linalg.solve(factor, residual - first * a - second * b)
    density = np.exp(-0.5 * (np.sum(left**2, axis=0) + a**2 + b**2)) / np.prod(np.diag(factor)) / (2.0 * np.pi) ** 4
    assert pair == pytest.approx(np.log(density.sum() * (z[1] - z[0]) ** 2), rel=1e-6)


def test_other_noise_on_some_rows_is_that_of_a_model_made_with_it() -> None:
    rng = np.random.default_rng(11)
    known = Explanation(np.linalg.cholesky(np.cov(rng.normal(size=(20, 60)))), rng.normal(size=(20, 4)))
    rows = np.isin(np.arange(20), [3, 4, 11])
    factor = np.where(rows, 1e-3, 1.0)[:, None] * known.factor
    made, found = Explanation(factor, known.nuisances), known.with_noise(rows, 1e-3)
    columns = rng.normal(size=(20, 5))
    anew = known.whitened_anew(known.whitened(columns), rows, 1e-3)
    assert np.allclose(anew, made.whitened(columns), rtol=1e-9)
    assert np.allclose(found.log_marginal(anew), made.log_marginal(made.whitened(columns)), rtol=1e-10)
    assert np.allclose(found.inverse_times(columns[:, 0], 1.2), made.inverse_times(columns[:, 0], 1.2), rtol=1e-8)


def test_more_nuisances_are_those_of_a_model_made_with_all() -> None:
    rng = np.random.default_rng(12)
    known = Explanation(np.linalg.cholesky(np.cov(rng.normal(size=(20, 60)))), rng.normal(size=(20, 4)))
    # asked for before, or what belongs to fewer nuisances might be kept
    residual, more = rng.normal(size=20), rng.normal(size=(20, 3))
    rows = np.arange(20).reshape(-1, 2)
    known.inverse_blocks(rows, 1.0)
    found = known.with_more(more)
    made = Explanation(known.factor, np.column_stack([known.nuisances, more]))
    assert np.allclose(found.log_marginal(residual[:, None]), made.log_marginal(residual[:, None]), rtol=1e-12)
    assert np.allclose(found.inverse_blocks(rows, 1.1), made.inverse_blocks(rows, 1.1))


def test_a_stack_of_forces_has_the_evidence_of_more_nuisances() -> None:
    rng = np.random.default_rng(13)
    known = Explanation(np.diag(rng.uniform(0.5, 2.0, 20)), rng.normal(size=(20, 4)))
    force, residuals = rng.normal(size=(20, 6)), rng.normal(size=(20, 3))
    found = StackEvidence(known, known.stack_of_forces([force])).log_places(residuals)[0]
    assert np.allclose(found, known.with_more(force).log_marginal(residuals), rtol=1e-10)
