"""Verdicts after their checks."""

import pytest

from warpbrain.inference.decide import CANNOT_SAY, NOTHING, VERDICTS, Decision, if_significant


@pytest.mark.parametrize("verdict", VERDICTS)
def test_a_claim_needs_rows_that_no_cause_seldom_gives(verdict):
    claimed = Decision(verdict, ("pressure",))
    assert if_significant(claimed, 0.049, 0.05) == claimed
    weak = if_significant(claimed, 0.06, 0.05)
    # that nothing is missing claims nothing
    assert weak == (claimed if verdict == NOTHING else Decision(CANNOT_SAY, ("pressure",)))
