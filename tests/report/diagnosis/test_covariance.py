"""`covariance.npz` tells of an effect that somebody brings what the tool finds of it."""

import numpy as np
import pytest

from warpbrain.diagnosis.result import REFITTED
from warpbrain.report.diagnosis.files import Recorded


def test_an_effect_stands_out_as_much_as_the_tool_finds(diagnosed, small_diagnosis):
    base = small_diagnosis.base
    covariance = np.load(diagnosed / "covariance.npz")["covariance"]
    assert len(Recorded.of(small_diagnosis)["observed"]) == len(covariance)
    np.testing.assert_array_equal(covariance, covariance.T)
    model = base.model.with_scale(small_diagnosis.weighted_sets[REFITTED].marginal.scale)
    for change in np.random.default_rng(1).normal(size=(5, len(covariance))):
        mine = np.sqrt(change @ np.linalg.solve(covariance.astype(float), change))
        own = np.linalg.norm(model.standardised(1e-3 * change))
        assert mine == pytest.approx(own, rel=1e-3)
