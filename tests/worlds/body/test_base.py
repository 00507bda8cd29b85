"""The base of a block that sinks under a weight of which its case says nothing."""

from pathlib import Path

import numpy as np
import pytest
from sinking_block import write_sinking

from warpbrain.estimation.options import Listener
from warpbrain.worlds.body.base import _CONVERGED, BaseFinder, _LinearModel
from warpbrain.worlds.body.states import Hypothesis, States


@pytest.fixture(scope="module")
def finder(tmp_path_factory: pytest.TempPathFactory) -> BaseFinder:
    case = write_sinking(Path(tmp_path_factory.mktemp("base")) / "case")
    return BaseFinder(States(case, "cpu"), 0.01, False, False, Listener())


def test_a_step_from_the_base_with_columns_about_it_is_short(finder):
    base = finder.find()
    linear = _LinearModel(finder, base.state, None)
    before, after = (
        linear.nuisances.coordinates(finder.prior, point)
        for point in (base.state.hypothesis, finder._next_hypothesis(linear))
    )
    assert np.abs(after - before).max() < _CONVERGED


def test_columns_are_made_anew_where_steps_do_not_shrink(finder, monkeypatch):
    """Steps of 1.6, 1.5, 0.7 and 0.3 standard deviations: the second is not much shorter, the third is."""
    count = 0

    class Counted(_LinearModel):
        def __init__(self, *arguments):
            nonlocal count
            count += 1
            super().__init__(*arguments)

    start = finder._declared()
    first = np.eye(len(start.theta))[0]
    steps = iter([1.6, 0.1, 0.8, 0.5])
    monkeypatch.setattr("warpbrain.worlds.body.base._LinearModel", Counted)
    monkeypatch.setattr(
        finder,
        "_next_hypothesis",
        lambda linear: Hypothesis(start.theta + finder.prior.factor @ (next(steps) * first), start.field),
    )
    base = finder.find()
    # about the declared state, the second step, and the base
    assert count == 3
    assert next(steps, None) is None
    np.testing.assert_allclose(base.state.hypothesis.theta, start.theta + 0.5 * finder.prior.factor[:, 0])
