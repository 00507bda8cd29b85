"""A local cause between the places of a scan, which moves points far."""

import numpy as np
from drawn_rows import draws

from warpbrain.inference.gross_errors import with_gross_errors
from warpbrain.inference.noise import outliers
from warpbrain.worlds.body.dictionary import BETWEEN, dictionary_of, switch_effects
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.placing import _around, best_in_cell


def test_a_cell_is_as_probable_as_the_mean_of_its_places_each_with_gross_errors_of_its_own(small_diagnosis):
    search = small_diagnosis.search
    base, spacing = search.base, search.spacing
    effects = search.candidates.effects["swelling"]
    effect = effects[len(effects) // 2]
    proposed = effect.proposed
    near = next(place for place in _around(base, proposed, 0.5 * spacing) if place.radius == proposed.radius)
    [true] = base.effects.of([near])
    rng = np.random.default_rng(0)
    # so large that in the wrong place some points are far off
    residual = 20.0 * true.columns[:, 0] + draws(base.model, 1, rng)[:, 0]
    size = 20.0
    start = effect.scaled(size)
    without = base.model
    best, gain = best_in_cell(base, base.effects, start, spacing, without, residual)
    away = np.linalg.norm(best.proposed.centre - true.proposed.centre)
    assert away < np.linalg.norm(proposed.centre - true.proposed.centre)

    def log_evidence(tried):
        model = base.model.with_columns(tried.columns)
        return with_gross_errors(model, residual - tried.mean, base.points, outliers()).log_density

    better = log_evidence(best) - log_evidence(start)
    assert better > 0.0
    # the mean of 81 places is at most as probable as the best of them, and at least its share of that
    assert -np.log(81.0) <= gain <= better
    assert gain >= log_evidence(true.scaled(size)) - log_evidence(start) - np.log(81.0) - 1e-6


def test_a_patch_that_lets_go_is_found_between_the_patches_of_a_scan(small_diagnosis):
    base = small_diagnosis.search.base
    proposals = dictionary_of(base.states.case, ("contact",)).proposals["contact"]

    def larger(disc):
        return disc.elsewhere(disc.centre, 1.25 * disc.radius)

    def members(disc):
        return disc.patch.members.sum()

    discs = [one for one in proposals if one.elsewhere is not None and one.make(np.ones(1)).lifts]
    # nodes are so far apart that some discs are the same set as larger ones
    discs = [disc for disc in discs if members(larger(disc)) > members(disc)]
    effects = [one for one in switch_effects(base.effects, discs) if isinstance(one, Effect)]
    effect = max(effects, key=lambda effect: np.linalg.norm(effect.columns))
    proposed = effect.proposed
    assert members(proposed) < proposed.patch.held.sum()
    true = switch_effects(base.effects, [larger(proposed)])[0]
    residual = true.mean
    best, _ = best_in_cell(base, base.effects, effect, BETWEEN * base.at.sensors.radius, base.model, residual)
    assert best.proposed.is_there_or_not

    def log_evidence(tried):
        model = base.model.with_columns(tried.columns)
        return with_gross_errors(model, residual - tried.mean, base.points, outliers()).log_density

    assert log_evidence(best) >= max(log_evidence(true), log_evidence(effect)) - 1e-6
