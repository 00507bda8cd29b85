"""How well displacements are known: columns beside those of the recordings, and beside states that are solved."""

from dataclasses import replace

import numpy as np

from warpbrain.diagnosis.result import REFITTED
from warpbrain.worlds.body.fit_columns import Layout
from warpbrain.worlds.body.uncertainty import displacement_columns, displacement_deviation


def test_nodes_move_as_the_rows_of_a_fit_do(small_diagnosis):
    """Rows of points are interpolated between nodes, so are their columns: those that the fit was made with."""
    base, best = small_diagnosis.base, small_diagnosis.best
    refit = best.refit
    assert refit is not None and refit.effects
    layout = Layout.of(base.nuisances, refit.marginal.sizes, len(refit.nuisances), refit.effects)
    columns = displacement_columns(best, base)
    of_rows = refit.state.sensors.by_displacement @ columns
    for part in (layout.tissue, layout.field, layout.shapes, base.nuisances.part("known loads"), layout.coefficients):
        size = np.abs(refit.columns[:, part]).max(initial=0.0)
        np.testing.assert_allclose(of_rows[:, part], refit.columns[:, part], atol=0.02 * size)
    registration = columns[:, base.nuisances.part("registration")]
    assert registration.shape[1] == 6 and not registration.any()


def test_a_larger_cause_moves_nodes_by_its_column(small_diagnosis, verify):
    base, best = small_diagnosis.base, small_diagnosis.best
    refit = best.refit
    layout = Layout.of(base.nuisances, refit.marginal.sizes, len(refit.nuisances), refit.effects)
    step, moved = 0.05, []
    for sign in (-1.0, 1.0):
        z = refit.coefficients[0].copy()
        z[0] += sign * step
        mechanisms = (refit.effects[0].proposed.make(refit.effects[0].coefficients(z)),)
        hypothesis = replace(refit.state.hypothesis, mechanisms=mechanisms)
        moved.append(base.states.solve(hypothesis, refit.state.u).u)
    expected = (moved[1] - moved[0]) / (2.0 * step)
    found = displacement_columns(best, base)[:, layout.effects[0].start].reshape(-1, 3)
    verify(
        "displacement of all nodes by a cause that is larger by a little, largest error",
        "equilibria with a smaller and a larger one",
        np.abs(found - expected).max() / np.abs(expected).max(),
        0.001,
    )


def test_recordings_make_displacements_known(small_diagnosis):
    base = small_diagnosis.base
    for weighted_set in (small_diagnosis.best, small_diagnosis.weighted_sets[REFITTED]):
        deviation = displacement_deviation(weighted_set, base)
        believed = np.linalg.norm(displacement_columns(weighted_set, base), axis=1).reshape(-1, 3)
        held = base.at.system.model.constrained.all(axis=1)
        assert np.isfinite(deviation).all() and not deviation[held].any()
        assert (deviation <= believed * (1.0 + 1e-9)).all()
        # nothing is declared to act on it: without a cause it is at rest, whatever it is made of
        assert weighted_set.effects or not deviation.any()
    deviation = displacement_deviation(small_diagnosis.best, base)
    believed = np.linalg.norm(displacement_columns(small_diagnosis.best, base), axis=1).reshape(-1, 3)
    assert 0.0 < deviation.max() < 0.2 * believed.max()
