"""What other laws change at a state: nothing where they are the law that is there; from which size effects are seen."""

import math

import numpy as np
import pytest
from slow_block import CAUSES, write_slow

from warpbrain.estimation.parameters import declared
from warpbrain.physics.mechanisms.asymmetry import Asymmetry
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.physics.mechanisms.pressure import Pressure
from warpbrain.physics.mechanisms.swelling import Swelling
from warpbrain.physics.proposal import Proposal
from warpbrain.physics.sizes import smallest_in_words
from warpbrain.worlds.body.effects import Effect, Effects
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.nuisances import other_volume
from warpbrain.worlds.body.parameters import smallest_of
from warpbrain.worlds.body.states import Hypothesis, States


@pytest.mark.parametrize("launched", ["alike", "in another way"])
def test_the_own_law_changes_nothing_beside_relaxing_stress(tmp_path, launched: str) -> None:
    states = States(write_slow(tmp_path / "case", CAUSES["viscoelasticity"]), "cpu")
    hypothesis = Hypothesis(declared(states.case, states.parameters), np.zeros(states.modes.shape[1]))
    # in the middle of its course, where stress is left that the end does not have
    state = states.solve(Hypothesis(hypothesis.theta, hypothesis.field, (CAUSES["viscoelasticity"],)))
    at = Linearisation(state.system, state.u, state.reactions, state.sensors)
    # of Ogden's law with the exponent 2, which is the neo-Hookean one
    other = Proposal.of_one(lambda a: Asymmetry(exponent=a), 2.0, 2.0, "smooth", 2.0)
    [effect] = Effects(at).of([other_volume(states) if launched == "alike" else other])
    assert np.abs(effect.mean).max() < 1e-8 * np.abs(effect.columns).max()
    assert np.abs(effect.columns).max() > 0.0


def _part_of_weight(share: float) -> Gravity:
    return Gravity(direction=(0.0, 0.0, -1.0), density=1000.0, ramp=((0.0, share),))


@pytest.mark.parametrize(
    ("proposal", "length", "size", "named", "plausible"),
    [
        # a local oedema of 10 % is half of what is usual, whatever is expected of all tissue
        (Proposal.of_one(lambda g: Swelling(amount=g), 0.0, 0.2, "smooth"), 10.0, 10.0, 20.0, True),
        # of a body that is fifty times as stiff pressures are larger
        (Proposal.of_one(lambda p: Pressure(nodes="a", value=p), 0.0, 2e4), 2.0, 5e4, math.inf, True),
        (Proposal.of_one(lambda p: Pressure(nodes="a", value=p), 0.0, 2e4), 1.0, 1e5, math.inf, False),
        # of a weight that is known to a tenth seven parts in ten would be seen: that is no seven deviations of it
        (Proposal.of_one(_part_of_weight, 1.0, 0.1), 5.0 / 7.0, 0.7, 1.4, True),
    ],
)
def test_what_would_be_seen_is_judged_by_what_is_looked_for(proposal, length, size, named, plausible) -> None:
    found = smallest_of(Effect(proposal, np.zeros(3), np.ones((3, 1))), length, 5.0, 10.0)
    assert found.size == pytest.approx(size) and found.named == pytest.approx(named)
    assert found.plausible == plausible
    assert smallest_in_words(proposal.make(proposal.mean).kind, found).startswith("from ") == plausible
