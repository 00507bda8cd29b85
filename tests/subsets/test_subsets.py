"""Shipped cases with some of their recordings end in a verdict or a sentence; `python -m reliability subsets` does it
with all."""

from dataclasses import replace

import pytest
from command import warpbrain
from drawn_for_commit import drawn_for_this_commit, files_for_this_commit
from reliability.kinds import KINDS

from subsets.tries import case_of, every_subset, one_try, subsets
from warpbrain.cases.shipped import RESECT
from warpbrain.cases.writing import write_case


def test_all_subsets():
    assert [len(some) for some in subsets(case_of("0684", "multi").recordings)] == [2, 1, 1, 0]


def test_a_commit_draws_the_same_in_every_process():
    drawn = drawn_for_this_commit(86, 3)
    assert drawn == drawn_for_this_commit(86, 3) and len(set(drawn)) == 3 and set(drawn) <= set(range(86))


def test_of_slow_files_that_take_as_long_one_runs_with_a_commit():
    seconds = {f"test_{number}.py": 400.0 / (1 + number) for number in range(60)}
    run = files_for_this_commit(seconds)
    # six take more than a minute
    assert len(run) == 1 + 14 and run == files_for_this_commit(seconds)
    assert 0.1 * sum(seconds.values()) < sum(seconds[name] for name in run) < 0.5 * sum(seconds.values())


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


@pytest.mark.slow(15)
def test_every_case_without_recordings_is_a_sentence(tmp_path):
    every = every_subset()
    assert len(every) == KINDS["subsets"].promised
    bare = [(name, tissue) for name, tissue, recordings in every if not recordings]
    assert len(bare) == 56 == len(every) - _WITH_RECORDINGS
    assert all(recordings for *_, recordings in every[:_WITH_RECORDINGS])
    # without their landmarks the patients of RESECT are one case
    for name, tissue in bare:
        if name in RESECT[1:]:
            continue
        case = write_case(tmp_path / f"{name}-{tissue}", replace(case_of(name, tissue), recordings=()))
        ran = warpbrain("diagnose", "--case", case, "--out", tmp_path / "out", "--quiet")
        assert ran.status == 2 and "recording" in ran.err and ran.err.count("\n") == 1
        assert not (tmp_path / "out").exists()


#: Subsets that are not empty, and how many of them are diagnosed at a time: a try takes up to seven minutes.
_WITH_RECORDINGS, _WITH_EACH_COMMIT = 86, 1


@pytest.mark.slow(400)
@pytest.mark.parametrize("number", drawn_for_this_commit(_WITH_RECORDINGS, _WITH_EACH_COMMIT))
def test_some_with_recordings_with_each_commit(number):
    """`python -m reliability subsets --seed NUMBER --tries 1` does the same with the error of the mesh."""
    _diagnose(*every_subset()[number])


#: A beam, which has one tissue only: every subset that is not empty. Landmarks: tests/cases/test_resect.py.
_OF_BEAM = (("markers", "markers, again"), ("markers",), ("markers, again",))


@pytest.mark.slow(16)
@pytest.mark.parametrize("names", _OF_BEAM)
def test_every_subset_of_a_beam(names):
    every = case_of("beam-gravity", "single").recordings
    some = tuple(recording for recording in every if recording.name in names)
    assert len(some) == len(names)
    _diagnose("beam-gravity", "single", some)


def _diagnose(name, tissue, some):
    ended = one_try(name, tissue, some, ["--no-discretisation"])
    assert not ended.defect
    assert ended.verdict or len(some) < len(case_of(name, tissue).recordings)
