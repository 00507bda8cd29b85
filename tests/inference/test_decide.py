"""The verdict of least expected loss: what it must say where the posterior leaves no doubt, and where it does."""

import numpy as np
import pytest

from warpbrain.inference.calibration import calibration
from warpbrain.inference.causes import Configuration, Hypothesis, Kind
from warpbrain.inference.decide import (
    CANNOT_SAY,
    GROUP,
    NAMED,
    NAMED_AND_REST,
    NOT_PHYSICS,
    NOTHING,
    UNKNOWN,
    Decision,
    Truth,
    decide,
    loss,
)

KINDS = {"unknown": Kind.UNKNOWN, "registration": Kind.NOT_PHYSICS, "mesh": Kind.NOT_PHYSICS}
LOSSES = calibration().losses


def hypothesis(*causes: str, log_evidence: float = 0.0) -> Hypothesis:
    kinds = tuple(KINDS.get(cause, Kind.PHYSICS) for cause in causes)
    return Hypothesis(causes, kinds, log_evidence, 0.0, Configuration((), 1.0, 0.0))


def verdict(*chances: tuple[tuple[str, ...], float]) -> Decision:
    each = [hypothesis(*causes) for causes, _ in chances]
    return decide(each, np.array([chance for _, chance in chances]), LOSSES)[0]


@pytest.mark.parametrize(
    ("causes", "expected"),
    [
        ((), Decision(NOTHING)),
        (("traction",), Decision(NAMED, ("traction",))),
        (("traction", "gravity"), None),
        (("traction", "unknown"), Decision(NAMED_AND_REST, ("traction",))),
        (("unknown",), Decision(UNKNOWN)),
        (("registration",), Decision(NOT_PHYSICS, ("registration",))),
    ],
)
def test_without_doubt_the_truth_is_said(causes, expected):
    found = verdict((causes, 0.999), ((), 0.001) if causes else (("traction",), 0.001))
    if expected is None:
        assert found.verdict == NAMED and set(found.causes) == set(causes)
    else:
        assert found == expected


def test_two_that_are_as_probable_are_a_group():
    assert verdict((("traction",), 0.5), (("pressure",), 0.5)) == Decision(GROUP, ("traction", "pressure"))


def test_what_may_be_nothing_has_no_name():
    assert verdict((("traction",), 0.6), ((), 0.4)).verdict == CANNOT_SAY


def test_physics_that_may_be_a_registration_is_not_named():
    assert verdict((("traction",), 0.7), (("registration",), 0.3)).verdict == CANNOT_SAY


def test_physics_that_may_act_beside_an_error_does_not_hide_it():
    """As little as physics that nothing speaks for hides that nothing is missing."""
    for chance in (0.1, 0.3):
        beside = verdict((("registration",), 1.0 - chance), (("registration", "traction"), chance))
        assert beside == Decision(NOT_PHYSICS, ("registration",))
    instead = verdict((("registration",), 0.7), (("traction",), 0.3))
    assert instead.verdict == CANNOT_SAY


def test_an_error_that_does_not_act_is_a_false_name_and_silence_about_physics():
    wrong = loss(Decision(NOT_PHYSICS, ("mesh",)), Truth.of(hypothesis("traction")), LOSSES)
    assert wrong == LOSSES["false name"] + LOSSES["nothing for something"]


@pytest.mark.parametrize("causes", [(), ("traction",), ("traction", "unknown"), ("unknown",), ("mesh",)])
def test_nothing_costs_less_than_the_truth(causes):
    truth = Truth.of(hypothesis(*causes))
    right = verdict((causes, 1.0))
    every = [Decision(NOTHING), Decision(CANNOT_SAY), Decision(UNKNOWN), Decision(NAMED, ("swelling",))]
    assert all(loss(right, truth, LOSSES) <= loss(other, truth, LOSSES) for other in every)


@pytest.mark.parametrize(
    ("said", "causes"),
    [
        (Decision(NOTHING), ("traction",)),
        (Decision(UNKNOWN), ("traction",)),
        (Decision(NAMED, ("swelling",)), ("traction",)),
        (Decision(GROUP, ("swelling", "gravity")), ("traction",)),
        (Decision(NOT_PHYSICS, ("mesh",)), ("traction",)),
        (Decision(NOT_PHYSICS, ("mesh",)), ()),
        (Decision(NAMED, ("swelling",)), ()),
        (Decision(UNKNOWN), ()),
    ],
)
def test_to_say_what_is_false_costs_more_than_silence(said, causes):
    truth = Truth.of(hypothesis(*causes))
    assert loss(said, truth, LOSSES) > loss(Decision(CANNOT_SAY), truth, LOSSES)


def test_a_name_needs_the_probability_that_its_losses_say():
    least = 1.0 - LOSSES["cannot say"] / LOSSES["false name"]
    others = tuple(((f"cause {k}",), 0.0) for k in range(3))
    # a little more than that: a group of two costs less than a name that is as good as any
    for chance, named in ((0.75 + 0.25 * least, True), (least - 0.05, False)):
        rest = (1.0 - chance) / len(others)
        spread = tuple((causes, rest) for causes, _ in others)
        assert (verdict((("traction",), chance), *spread).verdict == NAMED) == named


def test_probabilities_follow_log_probability_over_temperature():
    each = [hypothesis(log_evidence=0.0), hypothesis("traction", log_evidence=3.0)]
    chances = calibration().probabilities(each)
    np.testing.assert_allclose(np.log(chances[1] / chances[0]), 3.0 / calibration().temperature)
