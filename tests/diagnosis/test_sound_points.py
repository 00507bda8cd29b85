"""Points that were set aside: a gross error stays there, what a local cause moves comes back."""

from dataclasses import replace

import numpy as np
import pytest

from warpbrain.diagnosis.sound_points import sound_points as sound_points_of
from warpbrain.worlds.body.dictionary import candidates_at, dictionary_of


@pytest.fixture(scope="module")
def setting(small_diagnosis):
    base = small_diagnosis.base
    candidates = candidates_at(dictionary_of(small_diagnosis.case, ["swelling"]), base.effects, {})
    sensors = base.at.sensors
    noise = base.explanation.factor @ np.random.default_rng(5).normal(size=len(sensors))
    return base, candidates, noise


def sound_points(base, candidates):
    return sound_points_of(base, candidates, base.explanation, base.residual)


def aside(base, residual, group):
    rows = base.at.sensors.groups == group
    return replace(base, residual=residual).without(rows), rows


def test_the_point_that_a_local_cause_moves_most_comes_back(setting):
    base, candidates, noise = setting
    local = [effect for effect in candidates.effects if effect.proposed.centre is not None]
    effect = max(local, key=lambda one: np.abs(one.columns / base.sigma[:, None]).max())
    answer = 4.0 * effect.columns[:, 0]
    most = base.at.sensors.groups[np.argmax(np.abs(answer))]
    changed, rows = aside(base, answer + noise, most)
    assert np.array_equal(sound_points(changed, candidates), rows)


def point_near(base, place):
    """The recorded point that is nearest to a place, and where it is."""
    sensors = base.at.sensors
    each = np.unique(sensors.groups[sensors.is_displacement])
    points = np.array([sensors.positions[sensors.groups == group][0] for group in each])
    nearest = int(np.argmin(np.linalg.norm(points - place, axis=1)))
    return each[nearest], points[nearest]


def smallest_ball_at(candidates, place):
    """Answer of the sensors to a swelling at a place, of the smallest radius that is looked for."""
    local = [effect.proposed for effect in candidates.effects if effect.proposed.elsewhere is not None]
    [effect] = candidates.makes.of([local[0].elsewhere(place, min(one.radius for one in local))])
    return effect.columns[:, 0]


def test_so_does_one_between_the_places_of_the_scan(setting, monkeypatch):
    base, candidates, noise = setting
    # near an edge of the block, 10 mm from the nearest place of the scan
    group, place = point_near(base, [0.052, 0.011, 0.050])
    changed, rows = aside(base, 3.0 * smallest_ball_at(candidates, 0.9 * place) + noise, group)
    assert np.array_equal(sound_points(changed, candidates), rows)
    # by the places of the scan alone it is a gross error
    monkeypatch.setattr("warpbrain.diagnosis.sound_points._OPEN", 0.0)
    assert not sound_points(changed, candidates).any()


def test_so_do_two_beside_one_cause_that_were_both_set_aside(setting, monkeypatch):
    base, candidates, noise = setting
    (one, here), (other, there) = (point_near(base, at) for at in ([0.033, 0.057, 0.043], [0.049, 0.054, 0.049]))
    residual = 8.0 * smallest_ball_at(candidates, 0.5 * (here + there)) + noise
    changed, rows = aside(base, residual, one)
    changed = changed.without(changed.at.sensors.groups == other)
    assert np.array_equal(sound_points(changed, candidates), rows | (changed.at.sensors.groups == other))
    # alone neither of them does
    monkeypatch.setattr("warpbrain.diagnosis.sound_points._NEAR", 0.0)
    assert not sound_points(changed, candidates).any()


def test_so_does_one_beside_a_second_cause_once_the_first_is_known(setting):
    base, candidates, noise = setting
    local = [effect for effect in candidates.effects if effect.proposed.centre is not None]
    effect = max(local, key=lambda one: np.abs(one.columns / base.sigma[:, None]).max())
    second = 4.0 * effect.columns[:, 0]
    # something that no candidate explains moves everything, this point too
    first = 3e-3 * np.tile(np.sin(np.arange(len(noise) // 3))[:, None], 3).ravel()
    changed, rows = aside(base, first + second + noise, base.at.sensors.groups[np.argmax(np.abs(second))])
    assert not sound_points(changed, candidates).any()
    beside = changed.explanation.with_more(first[:, None])
    assert np.array_equal(sound_points_of(changed, candidates, beside, changed.residual), rows)


def test_two_gross_errors_near_each_other_do_not(setting):
    base, candidates, noise = setting
    (one, _), (other, _) = (point_near(base, at) for at in ([0.033, 0.057, 0.043], [0.049, 0.054, 0.049]))
    residual = noise.copy()
    for group, size in ((one, 12.0), (other, -15.0)):
        rows = base.at.sensors.groups == group
        residual[rows] += size * base.noise[rows] * [1.0, -1.0, 0.5]
    changed, _ = aside(base, residual, one)
    changed = changed.without(changed.at.sensors.groups == other)
    assert not sound_points(changed, candidates).any()


def test_a_gross_error_does_not(setting):
    base, candidates, noise = setting
    group = base.at.sensors.groups[np.flatnonzero(base.at.sensors.is_displacement)[0]]
    residual = noise.copy()
    residual[base.at.sensors.groups == group] += 12.0 * base.noise[base.at.sensors.groups == group]
    changed, _ = aside(base, residual, group)
    assert not sound_points(changed, candidates).any()


def test_where_nothing_was_set_aside_nothing_comes_back(setting):
    base, candidates, noise = setting
    none = replace(base, residual=noise).with_back(base.aside)
    assert not none.aside.any()
    assert not sound_points(none, candidates).any()
