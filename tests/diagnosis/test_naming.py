"""What is named beside what: in turn, or both of a group of two."""

from types import SimpleNamespace

import pytest

from warpbrain.diagnosis.naming import named_in_turn
from warpbrain.diagnosis.result import CANNOT_SAY, GROUP, NAMED, NOTHING
from warpbrain.diagnosis.verdict import Verdict


def stage(*known):
    return SimpleNamespace(known=known, fits=dict.fromkeys(("none", "gravity", "pressure", "contact")))


def judged(verdict, *kinds):
    return SimpleNamespace(verdict=Verdict(verdict, kinds))


def turns(at_first, says):
    """Stages, verdicts and what was looked for, where `says` has the judgement beside each tuple of kinds."""
    asked = []

    def beside(before, kind):
        known = (*before.known, kind)
        asked.append(known)
        return stage(*known), says.get(known, judged(NOTHING))

    stages, found = named_in_turn(stage(), at_first, beside)
    return [one.known for one in stages], [one.verdict.kinds for one in found], asked


def test_what_is_named_is_known_to_the_next_stage():
    says = {("gravity",): judged(NAMED, "pressure")}
    stages, kinds, _ = turns(judged(NAMED, "gravity"), says)
    assert stages == [(), ("gravity",), ("gravity", "pressure")]
    assert kinds == [("gravity",), ("pressure",), ()]


def test_no_more_than_three_are_named():
    says = {("gravity",): judged(NAMED, "pressure"), ("gravity", "pressure"): judged(NAMED, "contact")}
    stages, kinds, asked = turns(judged(NAMED, "gravity"), says)
    assert kinds == [("gravity",), ("pressure",), ("contact",)] and len(stages) == 3 and len(asked) == 2


@pytest.mark.parametrize("verdict", [GROUP, CANNOT_SAY])
def test_both_of_two_are_named_if_each_is_beside_the_other(verdict):
    says = {("gravity",): judged(NAMED, "pressure"), ("pressure",): judged(NAMED, "gravity")}
    stages, kinds, _ = turns(judged(verdict, "gravity", "pressure"), says)
    assert kinds == [("gravity",), ("pressure",), ()]
    assert stages == [(), ("gravity",), ("gravity", "pressure")]


@pytest.mark.parametrize(
    "says",
    [
        {},
        {("gravity",): judged(NAMED, "pressure")},
        {("gravity",): judged(NAMED, "contact"), ("pressure",): judged(NAMED, "gravity")},
        {("gravity",): judged(GROUP, "pressure", "contact"), ("pressure",): judged(NAMED, "gravity")},
    ],
    ids=["neither", "one", "another", "not told apart"],
)
def test_else_it_stays_a_group(says):
    stages, kinds, _ = turns(judged(GROUP, "gravity", "pressure"), says)
    assert stages == [()] and kinds == [("gravity", "pressure")]


@pytest.mark.parametrize("kinds", [("gravity", "pressure", "contact"), ("gravity", "unknown"), ("gravity",)])
def test_nothing_is_looked_for_beside_another_group(kinds):
    stages, found, asked = turns(judged(CANNOT_SAY, *kinds), {})
    assert stages == [()] and found == [kinds] and asked == []
