"""What is named beside what: in turn, or both of a group of two."""

from types import SimpleNamespace

import pytest

from warpbrain.diagnosis.naming import named_in_turn
from warpbrain.diagnosis.result import CANNOT_SAY, GROUP, NAMED, NOTHING, UNKNOWN
from warpbrain.diagnosis.verdict import Verdict


def stage(*known):
    return SimpleNamespace(known=known, fits=dict.fromkeys(("none", "gravity", "pressure")))


def judged(verdict, *kinds):
    log_evidence = {"unknown": 14.0, "gravity": 10.0, "pressure": 9.0, "contact": 1.0}
    ranking = [SimpleNamespace(kind=k, physics=k != "unknown", log_evidence=v) for k, v in log_evidence.items()]
    return SimpleNamespace(verdict=Verdict(verdict, kinds), ranking=ranking)


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


@pytest.mark.parametrize("kinds", [(), ("gravity",)])
def test_so_are_two_where_a_force_without_a_name_fits_better_than_each(kinds):
    says = {("gravity",): judged(NAMED, "pressure"), ("pressure",): judged(NAMED, "gravity")}
    stages, found, _ = turns(judged(UNKNOWN, *kinds), says)
    assert found == [("gravity",), ("pressure",), ()]
    assert stages == [(), ("gravity",), ("gravity", "pressure")]


def test_so_are_two_where_one_and_a_force_without_a_name_are_a_group():
    says = {("gravity",): judged(NAMED, "pressure"), ("pressure",): judged(NAMED, "gravity")}
    _, found, _ = turns(judged(GROUP, "gravity", "unknown"), says)
    assert found == [("gravity",), ("pressure",), ()]


def test_both_have_to_beat_a_force_without_a_name():
    first = judged(UNKNOWN)
    first.ranking[0].log_evidence = 18.0
    says = {("gravity",): judged(NAMED, "pressure"), ("pressure",): judged(NAMED, "gravity")}
    stages, found, _ = turns(first, says)
    assert stages == [()] and found == [()]


def test_the_second_may_have_had_no_fit_alone():
    says = {("gravity",): judged(NAMED, "contact"), ("contact",): judged(NAMED, "gravity")}
    first = judged(UNKNOWN)
    first.ranking[0].log_evidence = 8.0
    assert turns(first, says)[1] == [("gravity",), ("contact",), ()]


@pytest.mark.parametrize("second", ["pressure", "contact", "gravity"])
def test_it_stays_without_a_name_if_not_both_are(second):
    stages, found, _ = turns(judged(UNKNOWN), {("gravity",): judged(NAMED, second)})
    assert stages == [()] and found == [()]


@pytest.mark.parametrize("kinds", [("gravity", "pressure", "contact"), ("gravity", "unknown"), ("gravity",)])
def test_nothing_is_looked_for_beside_another_group(kinds):
    stages, found, asked = turns(judged(CANNOT_SAY, *kinds), {})
    assert stages == [()] and found == [kinds] and asked == []
