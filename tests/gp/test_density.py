"""The folded kernel density against integrals and against SciPy's."""

import numpy as np
import pytest
from scipy.stats import gaussian_kde

from warpbrain.gp.prior import FoldedDensity

INF = np.inf


def density(samples, low, high, clusters=None):
    samples = np.asarray(samples, dtype=float)
    none = np.zeros(len(samples), dtype=np.int64)
    return FoldedDensity(samples, np.array(low), np.array(high), none if clusters is None else clusters)


def test_without_sides_it_is_scotts():
    samples = np.random.default_rng(0).normal(size=(200, 2)) @ [[2.0, 1.0], [0.0, 0.3]]
    found = density(samples, [-INF, -INF], [INF, INF])
    at = samples[:20] + 0.1
    expected = gaussian_kde(samples.T).logpdf(at.T)
    # SciPy divides the covariance by n - 1
    np.testing.assert_allclose(found.log_density(at), expected, atol=0.0025)


@pytest.mark.parametrize("samples", [np.random.default_rng(1).beta(0.3, 0.2, 500), np.ones(50), np.zeros(50)])
def test_it_is_a_density_on_the_box(samples):
    """Also where all samples are on one side."""
    found = density(samples[:, None], [0.0], [1.0])
    r = np.linspace(0.0, 1.0, 20001)
    assert np.trapezoid(np.exp(found.log_density(r[:, None])), r) == pytest.approx(1.0, abs=1e-4)
    assert np.isneginf(found.log_density([[-0.01], [1.01]])).all()


def test_a_mass_on_a_side_stays_near_it():
    samples = np.column_stack([np.random.default_rng(2).normal(size=300), np.repeat([0.0, 1.0], 150)])
    found = density(samples, [-INF, 0.0], [INF, 1.0], np.repeat([0, 1], 150))
    near, between = found.log_density([[0.0, 0.01], [0.0, 0.5]])
    assert near > between + 20.0


def test_clusters_are_not_bridged():
    samples = np.concatenate([np.random.default_rng(3).normal(m, 0.5, 100) for m in (-8.0, 8.0)])[:, None]
    apart = density(samples, [-INF], [INF], np.repeat([0, 1], 100))
    together = density(samples, [-INF], [INF])
    assert apart.log_density([[0.0]])[0] < together.log_density([[0.0]])[0] - 10.0
    x = np.linspace(-15.0, 15.0, 3001)
    assert np.trapezoid(np.exp(apart.log_density(x[:, None])), x) == pytest.approx(1.0, abs=1e-6)
