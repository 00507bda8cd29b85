"""Tissue averaged over what may act: sums over sets against draws and against dense covariances."""

from pathlib import Path

import numpy as np
import pytest
from sinking_block import OPTIONS, write_sinking

from warpbrain.inference.causes import Kind
from warpbrain.worlds.body.hypotheses import HypothesisSearch, screened
from warpbrain.worlds.body.uncertainty import AveragedTissue, averaged_tissue


@pytest.fixture(scope="module")
def search(tmp_path_factory: pytest.TempPathFactory) -> HypothesisSearch:
    """Of a block that sinks under a weight of which its case says nothing."""
    case = write_sinking(Path(tmp_path_factory.mktemp("averaged")) / "case")
    return screened(case, "cpu", mesh_error=False, mechanisms=OPTIONS.candidates)


def test_moments_and_intervals_are_those_of_the_mixture(verify):
    random = np.random.default_rng(0)
    factors = random.normal(size=(3, 2, 2))
    probabilities = np.array([0.6, 0.3, 0.1])
    means, covariances = 3.0 * random.normal(size=(3, 2)), factors @ np.swapaxes(factors, 1, 2)
    mixture = AveragedTissue(None, 0.6, (), probabilities, means, covariances)
    kinds = random.choice(3, 200_000, p=probabilities)
    drawn = means[kinds] + np.einsum("nij,nj->ni", factors[kinds], random.normal(size=(len(kinds), 2)))
    size = np.sqrt(np.diag(mixture.covariance))
    off = np.abs(mixture.mean - drawn.mean(axis=0)) / size
    verify("tissue averaged over causes: mean", "200,000 draws of the mixture", off.max(), 0.01, "sd")
    off = np.abs(mixture.covariance - np.cov(drawn.T)) / np.outer(size, size)
    verify("tissue averaged over causes: covariance", "200,000 draws of the mixture", off.max(), 0.02)
    for probability in (0.5, 0.95):
        ends = mixture.interval(probability)
        for k in range(2):
            below = np.mean(drawn[:, k] < ends[k, 0]), np.mean(drawn[:, k] > ends[k, 1])
            np.testing.assert_allclose(below, 0.5 * (1.0 - probability), atol=0.005)


def test_one_set_has_its_own_interval():
    alone = AveragedTissue(None, 1.0, (), np.ones(1), np.array([[2.0]]), np.array([[[0.25]]]))
    np.testing.assert_allclose(alone.interval(0.95), [[2.0 - 0.5 * 1.959964, 2.0 + 0.5 * 1.959964]], atol=1e-6)


def test_what_the_case_leaves_out_is_what_may_act(search):
    found = averaged_tissue(search)
    assert found.nothing < 1e-6
    assert found.causes[0].name == "gravity" and found.causes[0].kind is Kind.PHYSICS
    assert found.causes[0].probability > 0.9
    np.testing.assert_allclose(found.probabilities.sum(), 1.0)


def test_tissue_of_each_set_against_conditioning_its_rows(search, verify):
    """Of theta and rows jointly normal: `Cov(theta, r) Cov(r)^-1 r`, written out densely."""
    found = averaged_tissue(search)
    base, worst = search.base, 0.0
    for number, one in enumerate(search.weighted_sets[:4]):
        U = one.columns
        S = one.marginal.noise.noise_factor @ one.marginal.noise.noise_factor.T + U @ U.T
        of_theta = base.prior.factor @ U[:, base.nuisances.part("tissue")].T
        mean = base.prior.mean + of_theta @ np.linalg.solve(S, one.residual)
        covariance = base.prior.covariance - of_theta @ np.linalg.solve(S, of_theta.T)
        size = np.sqrt(np.diag(covariance))
        worst = max(worst, *(np.abs(found.means[number] - mean) / size))
        worst = max(worst, np.abs(found.covariances[number] / covariance - 1.0).max())
    verify("tissue under a set of causes", "joint normal distribution of tissue and rows, dense", worst, 1e-6, "sd")


def test_absolute_stiffness_is_not_known_better_than_under_the_best_set(search):
    found = averaged_tissue(search)
    assert found.covariance[0, 0] >= found.probabilities @ found.covariances[:, 0, 0]
    low, high = found.interval(0.95)[0]
    assert low < np.log(1000.0) < high
