"""A result that is worse than doing nothing says so."""

import pytest

from warpbrain.report.comparison import IN_PART, NEARER, NO_NEARER, UNKNOWN, WORSE, explained


def entry(name, before, after, count=10, unit="mm"):
    return {"name": name, "before": before, "after": after, "count": count, "unit": unit}


def test_worse_than_no_motion():
    said = explained([entry("beads", 1.0, 1.5)])
    assert said.verdict == WORSE
    assert said.sentences == (
        "This simulation explains the recordings worse than no motion at all: RMSE 1.500 mm with it, 1.000 mm if "
        "nothing had moved.",
        "It explains 'beads' worse than no motion at all: RMSE 1.500 mm with it, 1.000 mm without.",
    )


def test_better_in_all_and_worse_in_one():
    said = explained([entry("a", 4.0, 2.0), entry("b", 1.0, 1.1, count=2)], "this estimate")
    assert said.verdict == IN_PART
    # rows count, not recordings
    assert said.before == pytest.approx(((10 * 16.0 + 2 * 1.0) / 12) ** 0.5)
    assert said.after == pytest.approx(((10 * 4.0 + 2 * 1.21) / 12) ** 0.5)
    assert said.sentences[0].startswith("This estimate takes 49 % off the error of no motion at all: RMSE 3.674 mm if")
    assert said.sentences[1].startswith("It explains 'b' worse than no motion at all")


def test_nearer_says_no_more():
    said = explained([entry("a", 4.0, 2.0)])
    assert said.verdict == NEARER and len(said.sentences) == 1


def test_a_state_that_does_not_move_is_not_worse():
    said = explained([entry("a", 1.0, 1.0)])
    assert said.verdict == NO_NEARER
    assert said.sentences == (
        "This simulation explains the recordings no better than no motion at all: RMSE 1.000 mm with it and without.",
    )


def test_forces_are_not_lengths():
    said = explained([entry("cell", 0.1, 0.2, unit="N")])
    assert (said.verdict, said.before) == (UNKNOWN, None)
    assert said.sentences == ("It explains 'cell' worse than no force at all: RMSE 0.2 N with it, 0.1 N without.",)


def test_nothing_recorded():
    assert explained([]).verdict == UNKNOWN and explained([]).sentences == ()
