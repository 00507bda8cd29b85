"""What is not known of a case: against full equilibria, the field as it is drawn, and what it can hide."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from referee.detectability import Detectability
from referee.draw import wanted
from referee.effects import Inclusion
from referee.equilibrium import NoTruth, balance
from referee.law import Demiray, Ogden
from referee.sensing import place_sensors
from referee.setting import BOTH_LAWS, DEMIRAY, FIELD, LENGTHS, OGDEN, draw_setting, random_field
from referee.sight import Change, Sight
from referee.sizing import Wish
from referee.truth import cap_force_of, solve_truth
from referee.unknowns import stiffness_modes, unknowns_of


@pytest.fixture(params=[3, 4], ids=["moved", "force"])
def known(request, small):
    """A setting, its problem, what its body does, what is not known of it and what is seen."""
    return known_of(request.param)


@cache
def known_of(seed):
    """Of the small body, which the tests of this file alone ask for."""
    random = np.random.default_rng(seed)
    setting = draw_setting(random, "phantom", False)
    while (setting.total is None) != (seed == 3) or not setting.surface or setting.times:
        setting = draw_setting(random, "phantom", False)
    setting = replace(setting, points=40, checks=10)
    problem = setting.problem()
    base = balance(problem)
    force = cap_force_of(problem, base.u)
    sight = Sight(setting, place_sensors(setting), base.u, force)
    return setting, problem, base, unknowns_of(problem, base), sight


def test_columns_are_those_of_full_equilibria(known):
    _, problem, base, unknowns, sight = known
    step = 0.02
    for k, label in enumerate(np.unique(problem.body.mesh.tissue)):
        factor = np.exp(step * (problem.body.mesh.tissue == label))[:, None]
        other = replace(problem, mu=problem.mu * factor, bulk=problem.bulk * factor)
        found = balance(other, base.u)
        full = Change((found.u - base.u)[None], cap_force_of(other, found.u) - cap_force_of(problem, base.u))
        rows = sight.rows(full.times(1.0 / step))
        # a difference over a step of 2 % is of first order: at most 1.3 % off
        np.testing.assert_allclose(sight.rows(unknowns.tissues[k]), rows, atol=0.02 * np.abs(rows).max())


def test_what_is_not_known_does_not_stand_out(known):
    setting, _, _, unknowns, sight = known
    seen = Detectability(sight, unknowns)
    own = [seen.d(change) for change in unknowns.drawn]
    # an amount of one standard deviation is never more than one of all that is not known
    assert 0.0 < max(own) < 1.0
    assert len(sight.rows(unknowns.drawn[0])) == 3 * 40 + 150 + (3 if setting.total is None else 0)
    # a patch of its own is seen by noise, though less than by noise alone
    move = np.zeros((1, *setting.body.points.shape))
    move[0, place_sensors(setting).fitted[:5]] = [0.0, 0.0, 1e-3]
    patch = Change(move, np.zeros(3))
    rows = sight.rows(patch)
    alone = np.sqrt(rows @ np.linalg.solve(sight.noise, rows))
    assert 1.0 < seen.d(patch) < alone
    # a size by which it stands out as much as is wanted
    assert seen.d(patch.times(seen.factor(patch, 4.0))) == pytest.approx(4.0, rel=0.1)


def test_noise_is_as_it_is_drawn(known):
    setting, _, _, _, sight = known
    random = np.random.default_rng(0)
    draws = []
    for _ in range(1500):
        blur = replace(setting.blur, seed=int(random.integers(2**31)), noise_scale=1.0)
        scale = random.uniform(0.8, 1.25) * setting.sigma / 0.3e-3
        draws.append(scale * blur.noise(sight.points)[:, 0])
    drawn = np.array(draws)
    count = len(drawn)
    square = np.mean(drawn**2, axis=1)
    # beyond four standard errors once in 16,000
    assert abs(np.diag(sight.noise)[0] - square.mean()) < 4.0 * square.std() / np.sqrt(count)
    expected = sight.noise[: 3 * 40 : 3, : 3 * 40 : 3]
    i, j = np.triu_indices(40, 1)
    products = drawn[:, i] * drawn[:, j]
    errors = (products.mean(axis=0) - expected[i, j]) / (products.std(axis=0) / np.sqrt(count))
    # the largest of 780 normal numbers is beyond 4.8 once in 800
    assert np.abs(errors).max() < 4.8


def test_modes_have_the_covariance_of_the_field():
    points = np.random.default_rng(0).uniform(0.0, 0.06, size=(80, 3))
    modes = stiffness_modes(points, np.linspace(1.0, 2.0, 80), 80)
    random = np.random.default_rng(1)
    draws = [
        random.uniform(*FIELD)
        * random_field(points, random.uniform(*LENGTHS[k % 2]), int(random.integers(2**31)))[:, 0]
        for k in range(1500)
    ]
    np.testing.assert_allclose(modes @ modes.T, np.cov(np.array(draws).T), atol=0.003)
    # few of them hold most of what is seen
    few = stiffness_modes(points, np.ones(80), 24)
    assert (few**2).sum() > 0.85 * (modes**2).sum()


def test_laws_stand_for_all_that_are_drawn():
    assert sum(share for _, share in BOTH_LAWS) == pytest.approx(1.0)
    numbers = np.array([(law.shares[0], *law.exponents) for law, _ in BOTH_LAWS if isinstance(law, Ogden)])
    ends = np.array(OGDEN)
    np.testing.assert_allclose(numbers.mean(axis=0), ends.mean(axis=1))
    np.testing.assert_allclose(np.cov(numbers.T, bias=True), np.diag(np.ptp(ends, axis=1) ** 2 / 12.0), atol=1e-12)
    b = [law.b for law, _ in BOTH_LAWS if isinstance(law, Demiray)]
    assert (np.mean(b), np.std(b)) == pytest.approx((np.mean(DEMIRAY), np.ptp(DEMIRAY) / np.sqrt(12.0)))


@pytest.mark.parametrize("known", [3], indirect=True, ids=["moved"])
def test_the_recorded_force_is_that_of_tissue_with_the_effect(known):
    setting, problem, base, _, _ = known
    # all tissue stiffer alike: a cap that is moved then moves the body as before, with a larger force
    whole = Inclusion(size=0.5, sign=1, centre=(0.0, 0.0, 0.0), radius=10.0)
    truth = solve_truth(setting, [Wish(lambda: whole, lambda most: 2.0)])
    ratio = np.exp(truth.effects[0].size)
    assert ratio > 1.2
    np.testing.assert_allclose(truth.force, ratio * cap_force_of(problem, base.u), rtol=1e-3)
    np.testing.assert_allclose(truth.u[0], truth.declared, atol=1e-5)


def test_what_is_wanted_can_be_reached():
    random = np.random.default_rng(0)
    found = [wanted(random, most=4.0) for _ in range(200)]
    assert min(found) >= 2.5 and max(found) <= 4.0
    assert max(wanted(random, most=np.inf) for _ in range(200)) > 25.0
    with pytest.raises(NoTruth, match=r"by 2\.4 only"):
        wanted(random, most=2.4)
