"""What a scan leaves open between neighbours: the change of the answer over a step, divided by the root of 12."""

import numpy as np
import pytest

from warpbrain.diagnosis.between import between_neighbours
from warpbrain.physics.mechanisms.pressure import Pressure
from warpbrain.physics.mechanisms.viscoelasticity import Viscoelasticity
from warpbrain.physics.proposal import Proposal
from warpbrain.worlds.body.dictionary import Candidates
from warpbrain.worlds.body.effects import Effect


def relaxing(time: float, answer: list[float]) -> Effect:
    proposal = Proposal.of_one(lambda c: Viscoelasticity(moduli=(max(c, 1e-6),), times=(time,)), 0.0, 2.0)
    return Effect(proposal, np.zeros(2), np.array(answer)[:, None])


@pytest.fixture
def candidates() -> Candidates:
    effects = (relaxing(1.0, [1.0, 0.0]), relaxing(3.0, [2.0, 1.0]), relaxing(10.0, [4.0, 5.0]))
    pressure = Proposal.of_one(lambda c: Pressure(nodes="wall", value=c), 0.0, 400.0)
    effects += (Effect(pressure, np.zeros(2), np.ones((2, 1))),)
    of_kind = {"viscoelasticity": np.arange(3), "pressure": np.array([3])}
    return Candidates(tuple(of_kind), effects, of_kind, frozenset(), {})


@pytest.mark.parametrize(("number", "change"), [(0, [1.0, 1.0]), (1, [1.5, 2.5]), (2, [2.0, 4.0])])
def test_a_step_of_the_scan(candidates, number, change):
    found = between_neighbours(candidates, "viscoelasticity", number, np.array([0.5]))
    np.testing.assert_allclose(found[:, 0], 0.5 * np.array(change) / np.sqrt(12.0))


def test_what_coefficients_set_leaves_nothing_open(candidates):
    def branch(c: np.ndarray) -> Viscoelasticity:
        return Viscoelasticity(moduli=(max(c[0], 1e-6),), times=(np.exp(c[1]),))

    fitted = tuple(
        Effect(Proposal(branch, np.array([0.0, np.log(time)]), np.array([2.0, 1.0])), np.zeros(2), columns)
        for time, columns in ((1.0, np.eye(2)), (3.0, 2.0 * np.eye(2)))
    )
    candidates = Candidates(("viscoelasticity",), fitted, {"viscoelasticity": np.arange(2)}, frozenset(), {})
    assert between_neighbours(candidates, "viscoelasticity", 0, np.array([0.5, 0.1])).shape == (2, 0)


def test_what_is_not_scanned_leaves_nothing_open(candidates):
    assert between_neighbours(candidates, "pressure", 3, np.array([1.0])).shape == (2, 0)
