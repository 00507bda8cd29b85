"""Case folders damaged at random: read, or refused in one line; `python -m reliability damage` does more of it."""

import pytest

from damage.folders_to_damage import write_whole
from damage.tries import judged, one_try
from warpbrain.cases.reading import read_case

#: Tries that were found wrong by this tool before they were mended, and a few of everything.
CORPUS = (291, 316, 366, *range(12))


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return write_whole(tmp_path_factory.mktemp("whole"))


def test_the_folder_is_sound(whole):
    assert len(read_case(whole).recordings) == 11
    outcome = judged(whole)
    assert (outcome.refused, outcome.defect) == ("", "")


@pytest.mark.parametrize("seed", CORPUS)
def test_what_was_wrong_before(whole, seed):
    assert one_try(whole, seed).defect == ""


@pytest.mark.slow(25)
def test_three_hundred_tries(whole):
    outcomes = [one_try(whole, seed) for seed in range(20_000, 20_300)]
    assert [outcome for outcome in outcomes if outcome.defect] == []
    # it does damage, and not every damage is one
    assert 150 < sum(bool(outcome.refused) for outcome in outcomes) < 295


def test_a_defect_is_seen(whole, monkeypatch):
    """The tool itself: an exception that is not ours is reported with its traceback."""

    def broken(_folder):
        raise KeyError("x")

    monkeypatch.setattr("damage.tries.read_case", broken)
    outcome = judged(whole, 7, "mesh.vtu", "cut_off")
    assert "KeyError" in outcome.defect and outcome.seed == 7
