"""Shipped cases with some of their recordings end in a verdict or a sentence; `python -m reliability subsets` does it
with all."""

from dataclasses import replace

import pytest
from command import warpbrain
from reliability.kinds import KINDS

from subsets.tries import case_of, every_subset, one_try, subsets
from warpbrain.cases.writing import write_case


def test_all_subsets():
    assert [len(some) for some in subsets(case_of("0684", "multi").recordings)] == [2, 1, 1, 0]


def test_without_recordings_it_is_a_sentence():
    ended = one_try("0684", "single", ())
    assert "recording" in ended.refused and not ended.defect


@pytest.mark.slow(16)
def test_where_nothing_can_be_rendered_it_is_a_verdict_too(tmp_path, monkeypatch):
    """As on a compute server, where all subsets are tried."""
    (tmp_path / "sitecustomize.py").write_text("import sys\nsys.modules['pyvista'] = None\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr("subsets.tries.find_spec", lambda _name: None)
    ended = one_try("beam-52g", "single", case_of("beam-52g", "single").recordings, ["--no-discretisation"])
    assert ended.verdict and not ended.defect


@pytest.mark.slow(30)
def test_every_case_without_recordings_is_a_sentence(tmp_path):
    every = every_subset()
    assert len(every) == KINDS["subsets"].promised
    bare = [(name, tissue) for name, tissue, recordings in every if not recordings]
    assert len(bare) == 56
    for name, tissue in bare:
        case = write_case(tmp_path / f"{name}-{tissue}", replace(case_of(name, tissue), recordings=()))
        ran = warpbrain("diagnose", "--case", case, "--out", tmp_path / "out", "--quiet")
        assert ran.status == 2 and "recording" in ran.err and ran.err.count("\n") == 1
        assert not (tmp_path / "out").exists()


#: Walls of a brain, landmarks of another, markers of a beam, which has one tissue only: every subset of each that is
#: not empty, some with one tissue and some with two. Landmarks with two tissues: tests/cases/test_resect.py.
_TRIED = (
    ("0684", "multi", ("ventricles", "cavity")),
    ("0684", "single", ("ventricles",)),
    ("0684", "multi", ("cavity",)),
    ("resect-02", "single", ("landmarks",)),
    ("beam-gravity", "single", ("markers", "markers, again")),
    ("beam-gravity", "single", ("markers",)),
    ("beam-gravity", "single", ("markers, again",)),
)


@pytest.mark.parametrize(
    ("name", "tissue", "names"),
    [pytest.param(*tried, marks=pytest.mark.slow(16 if "beam" in tried[0] else 100)) for tried in _TRIED],
)
def test_a_verdict_or_a_sentence(name, tissue, names):
    every = case_of(name, tissue).recordings
    some = tuple(recording for recording in every if recording.name in names)
    assert len(some) == len(names)
    ended = one_try(name, tissue, some, ["--no-discretisation"])
    assert not ended.defect
    assert ended.verdict or len(some) < len(every)
