"""Recordings with role `check` are compared with all that a fit has found, of registration too."""

from dataclasses import replace

import numpy as np
import pytest
from sinking_block import NOISE, OPTIONS

from warpbrain.diagnosis.checking import check_errors
from warpbrain.diagnosis.diagnose import Diagnosing
from warpbrain.diagnosis.result import EXPLAINED, REFITTED
from warpbrain.estimation.registration import realigned


def test_what_is_named_leaves_noise(small_diagnosis):
    declared, refitted, explained = small_diagnosis.fit.check
    # distances of points, of three components
    assert 0.9 * NOISE < explained / 3**0.5 < 1.2 * NOISE < refitted / 3**0.5 < declared


@pytest.mark.slow(4)
def test_a_wrong_registration_is_as_wrong_where_it_is_not_fitted(small_diagnosis):
    case = small_diagnosis.case
    moved_by = np.array([8e-4, -5e-4, 6e-4, 0.01, -0.005, 0.008])
    moved = realigned(case, -moved_by, small_diagnosis.base.states.centre)
    found = Diagnosing(moved, OPTIONS, "cpu").run()
    declared, _, explained = found.fit.check
    assert declared > np.linalg.norm(moved_by[:3]) / 2.0
    assert [one.kind for one in found.named] == ["gravity"]
    assert 0.9 * NOISE < explained / 3**0.5 < 1.2 * NOISE


def test_nothing_is_said_where_there_is_nothing_to_check(small_diagnosis):
    case = small_diagnosis.case
    fitted = replace(case, recordings=tuple(one for one in case.recordings if one.role == "fit"))
    assert check_errors(fitted, small_diagnosis.base, [small_diagnosis.weighted_sets[EXPLAINED].refit]) is None


@pytest.mark.parametrize("kind", [REFITTED, EXPLAINED])
def test_a_fit_is_compared_as_where_it_was_fitted(small_diagnosis, kind):
    # the recording that was fitted, as if it were to be checked
    case = small_diagnosis.case
    beads, _ = case.recordings
    fit = small_diagnosis.weighted_sets[kind].refit
    _, error = check_errors(
        replace(case, recordings=(beads, replace(beads, name="again", role="check"))), small_diagnosis.base, [fit]
    )
    # laws are linear about a state that is near to that of the fit
    assert error == pytest.approx(np.sqrt(3.0 * np.mean(fit.residual**2)), rel=2e-3)
