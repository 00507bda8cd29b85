"""Mistaken points: their density, sums over which points they are, and what they leave of an effect."""

import itertools
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import logsumexp

from referee.detectability import Spread
from referee.mistakes import LENGTHS, Mixture, draw, log_density

SIGMA = 0.25e-3


def test_density_is_that_of_draws_with_noise(verify):
    random = np.random.default_rng(0)
    places = draw(random, (200_000,)) + SIGMA * random.normal(size=(200_000, 3))
    found, _ = np.histogram(np.linalg.norm(places, axis=1), bins=np.linspace(0.0, 6e-3, 25))
    middles = np.linspace(0.0, 6e-3, 2401)[1::2]
    density = np.exp(log_density(np.outer(middles, [0.0, 0.6, 0.8]), np.tile(SIGMA**2 * np.eye(3), (1200, 1, 1))))
    shells = (4.0 * np.pi * middles**2 * density * 5e-6).reshape(24, 50).sum(axis=1)
    assert shells.sum() == pytest.approx(1.0, abs=1e-4)
    verify(
        "density of mistakes of which the place is known but for noise",
        "shares of 200,000 draws in shells of 0.25 mm",
        float(np.abs(found / 200_000 - shells).max()),
        # five standard errors of the largest share
        5.0 * float(np.sqrt(shells.max() / 200_000)),
    )


def test_where_noise_hides_their_least_length_only_their_spread_counts():
    random = np.random.default_rng(1)
    covariance = np.diag([3e-3, 3e-4, 3e-4]) ** 2
    # along what is well known; along the other axis next to nothing is told of a mistake
    x = np.array([[0.0, 2e-3, 0.0], [0.0, 0.0, 1e-3]])
    drawn = draw(random, (400_000,))
    inverse = np.linalg.inv(covariance)
    apart = x[:, None] - drawn
    exact = np.exp(-0.5 * np.einsum("kni,ij,knj->kn", apart, inverse, apart)).mean(axis=1)
    exact /= np.sqrt(np.linalg.det(2.0 * np.pi * covariance))
    np.testing.assert_allclose(log_density(x, np.tile(covariance, (2, 1, 1))), np.log(exact), atol=1.0)


@pytest.fixture
def few():
    """Four points that share what is not known, and an amount of noise beside them."""
    random = np.random.default_rng(2)
    columns = 0.3e-3 * random.normal(size=(2, 14))
    covariance = SIGMA**2 * np.eye(14) + columns.T @ columns
    return covariance, Mixture(np.linalg.inv(covariance), np.arange(12).reshape(4, 3), 0.1)


def test_density_with_mistakes_is_the_mean_over_them(few, verify):
    covariance, mixture = few
    random = np.random.default_rng(3)
    wrong = np.array([True, False, True, False])
    lost, kept = np.arange(12).reshape(4, 3)[wrong].ravel(), np.r_[3:6, 9:14]
    off = []
    for _ in range(4):
        w = np.linalg.cholesky(covariance) @ random.normal(size=14)
        w[lost] += draw(random, (2,)).ravel()
        # a mean over where the two may be by what the others tell, of the density of mistakes there
        gain = covariance[np.ix_(lost, kept)] @ np.linalg.inv(covariance[np.ix_(kept, kept)])
        left = covariance[np.ix_(lost, lost)] - gain @ covariance[np.ix_(kept, lost)]
        places = w[lost] - gain @ w[kept] + random.normal(size=(400_000, 6)) @ np.linalg.cholesky(left).T
        lengths = np.linalg.norm(places.reshape(-1, 2, 3), axis=2)
        inside = (lengths > LENGTHS[0]) & (lengths < LENGTHS[1])
        density = np.where(inside, 1.0 / (4.0 * np.pi * lengths**2 * (LENGTHS[1] - LENGTHS[0])), 0.0).prod(axis=1)
        inner = covariance[np.ix_(kept, kept)]
        log = np.log(density.mean()) - 0.5 * w[kept] @ np.linalg.solve(inner, w[kept])
        log -= 0.5 * np.linalg.slogdet(2.0 * np.pi * inner)[1] - 2.0 * np.log(0.1) - 2.0 * np.log(0.9)
        constant = -0.5 * np.linalg.slogdet(2.0 * np.pi * covariance)[1]
        off.append(abs(mixture.log_joint(w, wrong) + constant - log))
    verify("log density of rows with two mistaken points", "a mean over 400,000 places of both", max(off), 0.1, "nats")


def test_sum_over_mistakes_is_that_over_all_sets_of_them(few, verify):
    covariance, mixture = few
    random = np.random.default_rng(4)
    off = []
    for number in range(30):
        w = np.linalg.cholesky(covariance) @ random.normal(size=14)
        # of all sizes, also between noise and mistakes, where it is not plain which point is wrong
        w[:3] += (number % 6) * 1e-3 * np.array([0.6, 0.0, 0.8])
        w[6:9] += (number % 5) * 0.8e-3 * np.array([0.0, 1.0, 0.0])
        every = [mixture.log_joint(w, np.array(each)) for each in itertools.product([False, True], repeat=4)]
        off.append(abs(mixture.log_density(w)[0] - logsumexp(every)))
    verify(
        "log density of rows whose points may be mistaken",
        "sum over all sets of mistaken points",
        max(off),
        0.2,
        "nats",
    )


def spread(share, columns=None):
    """Thirty points, with or without a shared amount that is not known."""
    covariance = SIGMA**2 * np.eye(93)
    if columns is not None:
        covariance = covariance + columns.T @ columns
    sight = SimpleNamespace(setting=SimpleNamespace(gross=share, seed=5), numbers=np.arange(90).reshape(30, 3))
    return Spread(sight, covariance)


def effect(points, size):
    """A change (93,) of the first points by a size [m] each, in different directions."""
    random = np.random.default_rng(6)
    moves = random.normal(size=(30, 3))
    moves *= size / np.linalg.norm(moves, axis=1, keepdims=True)
    moves[points:] = 0.0
    return np.append(moves.ravel(), np.zeros(3))


def test_without_mistakes_it_is_the_plain_measure():
    random = np.random.default_rng(7)
    columns = 0.3e-3 * random.normal(size=(3, 93))
    other = effect(30, 0.2e-3)[None]
    whole = np.linalg.inv(SIGMA**2 * np.eye(93) + columns.T @ columns)
    delta = effect(12, 0.4e-3)
    assert spread(0.0, columns).d(delta) == pytest.approx(np.sqrt(delta @ whole @ delta))
    # less what the other can be
    stands = np.sqrt(other[0] @ whole @ other[0])
    along = (delta @ whole @ other[0]) / stands
    exact = np.sqrt(delta @ whole @ delta - along**2)
    assert spread(0.0, columns).d(delta, other) == pytest.approx(exact, rel=1e-3)


@pytest.mark.slow(1)
@pytest.mark.parametrize("points", [1, 3, 30])
@pytest.mark.parametrize("size", [0.3e-3, 1e-3, 3e-3, 5e-3])
def test_mistakes_never_let_more_be_seen(points, size):
    plain, *found = [spread(share).d(effect(points, size)) for share in (0.0, 0.01, 0.04, 0.15)]
    assert max(found) <= plain * (1.0 + 1e-9)
    # where no point moves as far as a mistake, hardly less than what the points that are mistaken would have shown
    if size <= 1e-3:
        assert found[1] > 0.9 * plain and found[0] >= found[1] >= found[2] > 0.8 * plain


@pytest.mark.parametrize("size", [2.3e-3, 3e-3, 3.7e-3])
def test_what_one_point_shows_is_no_more_than_a_mistake_costs(size):
    share = 0.04
    # of a sound point at most the density of noise, and of a mistake there by the odds that it is one
    noise = -1.5 * (np.log(2.0 * np.pi * SIGMA**2) + 1.0)
    random = np.random.default_rng(8)
    around = effect(1, size)[:3] + SIGMA * random.normal(size=(4000, 3))
    mistaken = log_density(around, np.tile(SIGMA**2 * np.eye(3), (4000, 1, 1))).mean()
    most = np.log((1.0 - share) / share) + noise - mistaken
    found = spread(share).d(effect(1, size))
    # twelve draws and their opposites have a standard error of 0.3 nats
    assert 0.5 * found**2 < most + 1.0
    assert found < 0.5 * spread(0.0).d(effect(1, size))
