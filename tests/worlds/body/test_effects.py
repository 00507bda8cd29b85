"""What other laws change at a state: nothing where they are the law that is there, whatever its terms remember."""

import numpy as np
import pytest
from slow_block import CAUSES, write_slow

from warpbrain.estimation.parameters import declared
from warpbrain.physics.mechanisms.asymmetry import Asymmetry
from warpbrain.physics.proposal import Proposal
from warpbrain.worlds.body.effects import Effects
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.nuisances import other_volume
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
