"""A folder of results belongs to one process at a time."""

import os
import subprocess
import sys
import time
from contextlib import contextmanager

import pytest

from warpbrain.errors import InputError
from warpbrain.terminal import result_folder as module
from warpbrain.terminal.result_folder import TakenError, choose_folder, claim, release

pytestmark = pytest.mark.skipif(os.name != "posix", reason="locks of POSIX")


@pytest.fixture(autouse=True)
def released():
    yield
    release()


@contextmanager
def another_process_has(folder):
    """A process that claims the folder and is killed when the block ends."""
    code = (
        f"from pathlib import Path; from warpbrain.terminal.result_folder import claim; claim(Path({str(folder)!r})); "
        "print('has it', flush=True); input()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None and process.stdout.readline() == "has it\n"
            yield
        finally:
            process.kill()


def test_two_processes(tmp_path, monkeypatch):
    """The second is refused, or takes the next name; a process that is killed has nothing any more."""
    monkeypatch.chdir(tmp_path)
    with another_process_has(tmp_path / "out"):
        with pytest.raises(
            TakenError, match="out: another process is writing its results there: choose another folder"
        ):
            choose_folder(tmp_path / "out", "", overwrite=True)
        assert choose_folder(None, "out", overwrite=False).name == "out-2"
    end = time.monotonic() + 10.0
    while True:
        try:
            claim(tmp_path / "out")
        except TakenError:
            assert time.monotonic() < end
            time.sleep(0.01)
        else:
            break
    release()
    assert list(tmp_path.iterdir()) == [tmp_path / "out"]


def test_the_same_process_has_what_it_has(tmp_path):
    claim(tmp_path / "out")
    claim(tmp_path / "out")
    (tmp_path / "link").symlink_to(tmp_path / "out")
    claim(tmp_path / "link")
    release()
    assert [path.name for path in tmp_path.iterdir()] == ["link"]


def test_what_a_killed_process_left_half_written_goes(tmp_path):
    (tmp_path / ".unfinished-result-abc.vtu").write_text("half")
    (tmp_path / ".unfinished-explained-abc").mkdir()
    (tmp_path / ".unfinished-explained-abc" / "case.toml").write_text("half")
    (tmp_path / ".config").write_text("mine")
    claim(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [".config"]


def test_a_place_that_cannot_be_a_folder(tmp_path):
    (tmp_path / "file").write_text("mine")
    for place in (tmp_path / "file", tmp_path / "file" / "out"):
        with pytest.raises(InputError, match="cannot be made a folder for output"):
            claim(place)


@pytest.mark.parametrize("absent", ["module", "locks"])
def test_without_locks_nothing_is_claimed(tmp_path, monkeypatch, absent):
    def none(*_values):
        raise OSError(37, "No locks available")

    if absent == "module":
        monkeypatch.setattr(module, "fcntl", None)
    else:
        monkeypatch.setattr(module.fcntl, "flock", none)
    with another_process_has(tmp_path):
        claim(tmp_path)


def test_a_folder_that_goes_away_while_it_is_claimed(tmp_path, monkeypatch):
    """Whoever made it found no use for it: it is made again."""
    lock, gone = module._lock, []

    def late(folder):
        if not gone:
            gone.append(folder)
            folder.rmdir()
        return lock(folder)

    monkeypatch.setattr(module, "_lock", late)
    claim(tmp_path / "out")
    assert gone and (tmp_path / "out").is_dir()
