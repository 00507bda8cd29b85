"""Baselines on cases in the neutral format whose answers are known."""

from dataclasses import replace

import numpy as np
import pytest
from neutral_cases import neutral

from referee.baselines import METHODS
from referee.baselines.forward_selection import bic
from referee.baselines.whitened import whitened


@pytest.mark.parametrize("method", METHODS)
def test_an_effect_is_named_and_noise_is_not(method):
    nothing = neutral()
    assert METHODS[method](whitened(nothing)).verdict == "nothing missing"
    effect = 8.0 * nothing.cause_response[:, nothing.cause_name == "pressure"].sum(axis=1)
    answer = METHODS[method](whitened(replace(nothing, recorded=nothing.recorded + effect)))
    assert (answer.verdict, answer.names) == ("named", ("pressure",))
    assert answer.probability is not None and 0.0 <= answer.probability <= 1.0


def test_what_is_smooth_and_has_no_name_is_a_discrepancy():
    case = neutral()
    smooth = 2e-3 * np.exp(-0.5 * ((case.sensor_place - 0.05) ** 2).sum(axis=1) / 0.04**2)
    case = replace(case, recorded=case.recorded + smooth * case.sensor_direction[:, 0])
    assert METHODS["gp-discrepancy"](whitened(case)).verdict == "unknown"


def test_a_gross_error_is_no_effect():
    case = neutral()
    wrong = case.recorded.copy()
    wrong[case.sensor_point == 7] += 3e-3
    problem = whitened(replace(case, recorded=wrong))
    assert np.abs(problem.y).max() < 5.0
    assert METHODS["gp-discrepancy"](problem).verdict == "nothing missing"


def test_bic_by_hand():
    y, columns = np.array([1.0, 2.0, 3.0, 5.0]), np.ones((4, 1))
    assert bic(y, columns) == pytest.approx(4 * np.log(y.var()) + np.log(4))
