"""A local cause between the places of a scan, which moves points far."""

import numpy as np

from warpbrain.inference.gross_errors import with_gross_errors
from warpbrain.inference.noise import outliers
from warpbrain.worlds.body.causes import scaled
from warpbrain.worlds.body.placing import best_in_cell


def test_a_cell_is_as_probable_as_the_mean_of_its_places_each_with_gross_errors_of_its_own(small_diagnosis):
    search = small_diagnosis.search
    base, spacing = search.base, search.spacing
    numbers = search.candidates.of_kind["swelling"]
    effect = search.candidates.effects[numbers[len(numbers) // 2]]
    proposed = effect.proposed
    [true] = base.effects.of([proposed.elsewhere(proposed.centre + 0.5 * spacing * np.eye(3)[0], proposed.radius)])
    rng = np.random.default_rng(0)
    # so large that in the wrong place some points are far off
    residual = 20.0 * true.columns[:, 0] + base.model.draws(1, rng)[:, 0]
    size = 20.0
    start = scaled(effect, size)
    without = base.model
    best = best_in_cell(base, base.effects, start, size, spacing, without, residual)
    away = np.linalg.norm(best.effect.proposed.centre - true.proposed.centre)
    assert away < np.linalg.norm(proposed.centre - true.proposed.centre)

    def log_evidence(tried):
        model = base.model.with_columns(tried.columns)
        return with_gross_errors(model, residual - tried.mean, base.points, outliers()).log_density

    better = log_evidence(best.effect) - log_evidence(start)
    assert better > 0.0
    # the mean of 21 places is at most as probable as the best of them, and at least its share of that
    assert -np.log(21.0) <= best.gain <= better
    assert best.gain >= log_evidence(scaled(true, size)) - log_evidence(start) - np.log(21.0) - 1e-6
