"""What is not known of the shape of mechanisms in one place."""

import numpy as np

from warpbrain.inference.beliefs import belief
from warpbrain.worlds.body.nuisances import SHAPE_MODES, SHAPED_EFFECTS, SHAPES
from warpbrain.worlds.body.shapes import columns_of_other_shapes


def _ball_and_weight(search):
    effects = search.candidates.effects
    balls = [effect for effect in effects["swelling"] if effect.proposed.centre is not None]
    return balls[len(balls) // 2], effects["gravity"][0]


def test_a_larger_ball_is_one_with_a_larger_radius_in_part(small_diagnosis):
    """The columns of other radii are differences of two responses, as large as what acts."""
    search = small_diagnosis.search
    base = search.base
    ball, _ = _ball_and_weight(search)
    proposed, z = ball.proposed, np.array([0.7])
    columns = columns_of_other_shapes(base.at, [ball], [z])
    here, larger = base.effects.of([proposed, proposed.elsewhere(proposed.centre, 1.25 * proposed.radius)])
    expected = belief("causes.shape") / np.sqrt(SHAPE_MODES) * 0.7 * (larger.columns[:, 0] - here.columns[:, 0])
    np.testing.assert_allclose(columns[:, 1], expected, atol=1e-6 * np.abs(here.columns).max())
    twice = columns_of_other_shapes(base.at, [ball], [2.0 * z])
    np.testing.assert_allclose(twice, 2.0 * columns, rtol=1e-9)


def test_what_acts_everywhere_has_no_shape(small_diagnosis):
    search = small_diagnosis.search
    base = search.base
    ball, weight = _ball_and_weight(search)
    z = [np.zeros(len(weight.proposed.mean)), np.ones(1)]
    columns = columns_of_other_shapes(base.at, [weight, ball], z)
    of_weight, of_ball, of_none = np.split(columns, SHAPED_EFFECTS, axis=1)
    assert not of_weight.any() and not of_none.any()
    assert of_ball.any(axis=0).all() and of_ball.shape[1] == SHAPE_MODES


def test_a_mechanism_that_is_left_out_takes_its_shapes_with_it(small_diagnosis):
    nuisances = small_diagnosis.search.base.nuisances
    rng = np.random.default_rng(0)
    columns = rng.normal(size=(4, nuisances.columns.shape[1] + 5))
    part = nuisances.part(SHAPES)
    first, second, third = np.split(columns[:, part], SHAPED_EFFECTS, axis=1)
    for number, left in enumerate(([second, third], [first, third], [first, second])):
        without = nuisances.without_shapes_of(number, columns)
        np.testing.assert_array_equal(without[:, part], np.hstack([*left, np.zeros_like(first)]))
        np.testing.assert_array_equal(np.delete(without, np.r_[part], axis=1), np.delete(columns, np.r_[part], axis=1))
    np.testing.assert_array_equal(nuisances.without_shapes_of(SHAPED_EFFECTS, columns), columns)
