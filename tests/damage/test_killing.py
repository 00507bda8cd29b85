"""Commands killed at random moments, and on a full disk; `python -m reliability kill-run` and others do more of it."""

import os

import pytest
from drawn_for_commit import some_for_this_commit

pytestmark = pytest.mark.skipif(os.name != "posix", reason="forks and kills")


@pytest.fixture(scope="module")
def killing(tmp_path_factory):
    from damage.killing import killers

    return killers(tmp_path_factory.mktemp("killed"), ("run", "ensemble"))


@pytest.fixture(scope="module")
def killing_builds(tmp_path_factory):
    from damage.killing import killers

    return killers(tmp_path_factory.mktemp("killed"), ("cases build",))["cases build"]


@pytest.mark.parametrize(("name", "seeds"), [("run", (1, 4)), ("ensemble", (1, 5))])
def test_killed_and_repeated(killing, name, seeds):
    assert [killed for killed in map(killing[name], seeds) if killed.defect] == []


@pytest.mark.slow(3)
def test_builds_killed_and_repeated(killing_builds):
    assert [killed for killed in map(killing_builds, range(6)) if killed.defect] == []


@pytest.mark.slow(30)
def test_all_commands(tmp_path):
    from damage.killing import killers

    seeds = some_for_this_commit(range(100, 104), 2)
    for kill in killers(tmp_path).values():
        assert [killed for killed in map(kill, seeds) if killed.defect] == []


@pytest.mark.slow(5)
def test_a_defect_is_seen(killing_builds, monkeypatch):
    """The tool itself: files that are written in place are found half-written."""
    from contextlib import contextmanager

    from damage.killing import WAYS

    @contextmanager
    def in_place(path):
        yield path

    monkeypatch.setattr("warpbrain.atomic.whole_file", in_place)
    monkeypatch.setattr("warpbrain.mesh.files.whole_file", in_place)
    found = [killing_builds(seed) for seed in range(12)]
    assert any("is neither old nor new" in killed.defect for killed in found)
    assert {killed.way for killed in found} == set(WAYS)
