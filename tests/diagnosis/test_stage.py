"""An alarm of the linear model has to stand by what is refitted."""

from dataclasses import replace

import numpy as np
import pytest

from warpbrain.diagnosis.stage import Stage, compared
from warpbrain.worlds.body.dictionary import candidates_at, dictionary_of


@pytest.fixture(scope="module")
def alarmed(small_diagnosis) -> Stage:
    """Of a block in which something swells, to first order."""
    base = small_diagnosis.base
    candidates = candidates_at(dictionary_of(small_diagnosis.case, ["swelling"]), base.effects, {})
    noise = base.explanation.factor @ np.random.default_rng(3).normal(size=len(base.residual))
    residual = 5.0 * candidates.effects[0].columns[:, 0] + noise
    return compared(base, (), candidates, base.explanation, residual, 1.0, 99, np.random.default_rng(4))


def test_without_refits_it_is_as_likely_as_the_screening_says(alarmed):
    assert alarmed.p_value == pytest.approx(0.01)
    none = replace(alarmed, fits={"none": None})
    assert none.p_value == alarmed.p_value


@pytest.mark.parametrize(("nats", "p"), [(-9.0, 1.0), (50.0, 0.01)], ids=["refits deny it", "refits are surer"])
def test_it_is_no_more_than_refits_leave_of_it(alarmed, monkeypatch, nats, p):
    monkeypatch.setattr(Stage, "log_evidence", lambda self: dict.fromkeys(self.screen.kinds, nats))
    refitted = replace(alarmed, fits={"none": None, "swelling": None})
    assert refitted.p_value == pytest.approx(p)
