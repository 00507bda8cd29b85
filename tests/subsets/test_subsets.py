"""Shipped cases with some of their recordings end in a verdict or a sentence; `python -m subsets` does it with all."""

import pytest

from subsets.tries import TISSUES, one_try, subsets
from warpbrain.cases.shipped import find_case


def test_all_subsets():
    assert [len(some) for some in subsets(find_case("0684").recordings)] == [2, 1, 1, 0]


def test_without_recordings_it_is_a_sentence():
    ended = one_try("0684", "single", ())
    assert "recording" in ended.refused and not ended.defect


@pytest.mark.slow
@pytest.mark.parametrize("tissue", TISSUES)
@pytest.mark.parametrize("name", ["0684", "resect-02", "beam-gravity"])
def test_a_verdict_or_a_sentence(name, tissue):
    ended = [one_try(name, tissue, some, ["--no-discretisation"]) for some in subsets(find_case(name).recordings)]
    assert [one for one in ended if one.defect] == []
    assert ended[0].verdict
