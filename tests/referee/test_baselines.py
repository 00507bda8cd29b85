"""Simpler methods on regressions whose answers are known, and on a case."""

import numpy as np
import pytest

from referee import make
from referee.baselines.choosing import bic, lasso, stepwise
from referee.baselines.dictionary import Regression, regression_of
from referee.plan import Planned
from warpbrain.cases.reading import read_case


@pytest.fixture
def regression():
    random = np.random.default_rng(2)
    nuisances = random.normal(size=(200, 3))
    candidates = [(name, random.normal(size=(200, 2))) for name in ("gravity", "pressure", "swelling")]
    return Regression(random.normal(size=200), nuisances, candidates)


@pytest.mark.parametrize("choose", [stepwise, lasso])
def test_an_effect_is_found_and_noise_is_not(regression, choose):
    nuisance = regression.nuisances @ [9.0, -9.0, 9.0]
    alone = Regression(regression.y + nuisance, regression.nuisances, regression.candidates)
    assert choose(alone) == ""
    effect = regression.candidates[1][1] @ [0.7, -0.7]
    assert choose(Regression(alone.y + effect, regression.nuisances, regression.candidates)) == "pressure"


def test_bic_by_hand():
    y, columns = np.array([1.0, 2.0, 3.0, 5.0]), np.ones((4, 1))
    assert bic(y, columns) == pytest.approx(4 * np.log(y.var()) + np.log(4))


def test_a_case_becomes_a_regression(small, tmp_path):
    make.make_case(tmp_path, "case-001", Planned("effect", ("pressure",), "phantom"), [7, 5])
    found = regression_of(read_case(tmp_path / "cases" / "case-001"))
    assert found.nuisances.shape == (len(found.y), 8)
    assert {name for name, _ in found.candidates} >= {"gravity", "pressure", "traction", "swelling", "contact"}
    assert all(np.isfinite(columns).all() for _, columns in found.candidates)
    # the highest level of fluid may leave no element of so coarse a mesh dry
    assert {name for name, columns in found.candidates if columns.any()} == {name for name, _ in found.candidates}
