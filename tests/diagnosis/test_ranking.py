"""What the ranking says of causes that were not fitted."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from warpbrain.diagnosis.checking import Confirming
from warpbrain.diagnosis.ranking import Ranking
from warpbrain.physics.mechanisms.swelling import Swelling
from warpbrain.physics.proposal import Proposal
from warpbrain.worlds.body.weighted_set import WeightedSet
from warpbrain.worlds.verdict import Ranked


def test_a_cause_that_could_not_be_simulated_says_why(small_diagnosis):
    search = small_diagnosis.search
    fitted = next(s for s in search.weighted_sets if s.mechanisms and s.refit is not None)
    ranking = Ranking(Confirming(search, 100, np.random.default_rng(0), 0.05))
    failed = replace(fitted, refit=None, failure="no equilibrium at 3 % of the load")
    names = fitted.mechanisms[:1]
    [row] = rows_of(ranking, fitted, names)
    assert row.rejected_because == ""
    [row] = rows_of(ranking, failed, names)
    assert row.rejected_because == (
        "as large as it is seen it could not be simulated: no equilibrium at 3 % of the load"
    )


def test_a_size_that_cannot_be_is_told_of_no_linear_model(small_diagnosis):
    search = small_diagnosis.search
    linear = next(s for s in search.weighted_sets if s.acting == ("swelling",) and s.refit is None)
    ranking = Ranking(Confirming(search, 100, np.random.default_rng(0), 0.05))
    [row] = rows_of(ranking, linear, ("swelling",))
    assert "amount" in {value.name for value in row.values}
    # the same columns, of a body that would shrink by all of its volume and more
    shrunk = Proposal.of_one(lambda g: Swelling(amount=1e-3 * g - 1.32), 0.0, 1.0, "smooth")
    [effect] = linear.effects
    [row] = rows_of(ranking, replace(linear, effects=(replace(effect, proposal=shrunk),)), ("swelling",))
    assert "amount" not in {value.name for value in row.values}
    assert row.rejected_because.endswith("would not be -90 to 400 %")


def test_what_is_named_is_ranked_as_the_verdict_has_it(small_diagnosis):
    named = {ranked.kind: ranked for ranked in small_diagnosis.named}
    assert named
    assert all(named.get(ranked.kind, ranked) is ranked for ranked in small_diagnosis.ranking)


def rows_of(ranking: Ranking, weighted_set: WeightedSet, names: Sequence[str]) -> list[Ranked]:
    """Rows of some causes where a set is that of the verdict."""
    return [row for row in ranking.all(weighted_set) if row.kind in names]
