"""Coordinates of the place of a mechanism: their derivatives are those of equilibria."""

from dataclasses import replace

import numpy as np
import pytest
from equilibria_elsewhere import assert_columns_are_differences

from warpbrain.worlds.body.places import LikelyPlaces, PlaceCoordinates, faces_for


def _ball(search):
    """A swelling in one place, near the middle of the recorded points."""
    middle = search.base.at.sensors.positions.mean(axis=0)
    placed = [effect for effect in search.candidates.effects["swelling"] if effect.is_placed]
    return min(placed, key=lambda effect: np.linalg.norm(effect.proposed.centre - middle))


def test_columns_are_differences_of_equilibria_with_it_elsewhere(small_diagnosis):
    search = small_diagnosis.search
    base, effect, z = search.base, _ball(search), np.array([0.8])
    place = PlaceCoordinates(base.at.system.model, effect.proposed, 0.5 * search.spacing)
    assert_columns_are_differences(base, place, effect, z)


def test_what_acts_on_a_surface_stays_on_it(small_diagnosis):
    search = small_diagnosis.search
    model = search.base.at.system.model
    corners = model.mesh.points[faces_for(model, None)]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    ball = replace(_ball(search).proposed, on_surface=True)
    place = PlaceCoordinates(model, ball, 0.01)
    for p in np.random.default_rng(0).normal(size=(5, 4)):
        there = place.at(p)
        heights = np.abs(np.einsum("ki,ki->k", normals, there.centre - corners[:, 0]))
        assert heights.min() < 1e-9
        assert there.radius == pytest.approx(ball.radius * 1.25 ** p[3])


def test_the_spread_of_a_place_has_its_covariance(small_diagnosis):
    search = small_diagnosis.search
    effect = _ball(search)
    place = PlaceCoordinates(search.base.at.system.model, effect.proposed, 0.01)
    random = np.random.default_rng(1)
    factor, mean = 0.1 * random.normal(size=(4, 4)), 0.05 * random.normal(size=4)
    effects, weights = LikelyPlaces(place, mean, factor @ factor.T).spread(effect)
    expected = factor @ factor.T + np.outer(mean, mean)
    radii = np.log([each.proposed.radius / effect.proposed.radius for each in effects]) / np.log(1.25)
    away = np.array([each.proposed.centre - effect.proposed.centre for each in effects]) / 0.01
    assert weights.sum() == pytest.approx(1.0)
    assert weights @ radii**2 == pytest.approx(expected[3, 3])
    # axes of the body are orthonormal
    assert weights @ np.sum(away**2, axis=1) == pytest.approx(np.trace(expected[:3, :3]))
    assert all(each.size == effect.size for each in effects)
