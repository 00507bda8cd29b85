"""What the ranking says of causes that were not fitted."""

from dataclasses import replace

import numpy as np

from warpbrain.diagnosis.checking import Confirming
from warpbrain.diagnosis.ranking import Ranking


def test_a_cause_that_could_not_be_simulated_says_why(small_diagnosis):
    search = small_diagnosis.search
    fitted = next(s for s in search.weighted_sets if s.mechanisms and s.refit is not None)
    ranking = Ranking(search, Confirming(search, 100, np.random.default_rng(0), 0.05))
    failed = replace(fitted, refit=None, failure="no equilibrium at 3 % of the load")
    names = fitted.mechanisms[:1]
    [row] = ranking.named(fitted, names)
    assert row.rejected_because == ""
    [row] = ranking.named(failed, names)
    assert row.rejected_because == (
        "as large as it is seen it could not be simulated: no equilibrium at 3 % of the load"
    )
