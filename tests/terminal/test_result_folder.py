"""Folders of results: not overwritten without being asked for, never left empty, and with a log of what made them."""

import warnings

import pytest

from warpbrain.errors import InputError
from warpbrain.terminal.record import LOG, Record, files_of
from warpbrain.terminal.result_folder import MARKS, choose_folder, release, results_in


@pytest.fixture(autouse=True)
def released():
    yield
    release()


def write_results(folder, name="summary.json", record=None, replace=False):
    record = record or Record(("run",), quiet=True)
    with results_in(folder, record, replace):
        (folder / name).write_text("{}")
        record.files.append(name)


@pytest.mark.parametrize("mark", MARKS)
def test_a_folder_with_results_is_refused(tmp_path, mark):
    write_results(tmp_path / "out", mark)
    with pytest.raises(InputError, match=rf"out: has results already \({mark}\): --overwrite replaces them"):
        choose_folder(tmp_path / "out", "usual", overwrite=False)
    assert choose_folder(tmp_path / "out", "usual", overwrite=True) == tmp_path / "out"
    assert choose_folder(tmp_path / "out", "usual", overwrite=False, allowed_marks=[mark]) == tmp_path / "out"


def test_without_out_the_next_free_name_is_taken(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = []
    for _ in range(3):
        names.append(choose_folder(None, "warpbrain-x", overwrite=False))
        write_results(names[-1])
    assert [name.name for name in names] == ["warpbrain-x", "warpbrain-x-2", "warpbrain-x-3"]
    assert choose_folder(None, "warpbrain-x", overwrite=True).name == "warpbrain-x"


def test_what_is_no_result_is_in_nobodys_way(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    assert choose_folder(tmp_path, "", overwrite=False) == tmp_path
    write_results(tmp_path)
    write_results(tmp_path, replace=True)
    assert (tmp_path / "notes.txt").read_text() == "mine"


def test_a_folder_that_was_made_for_nothing_goes_again(tmp_path):
    folder = choose_folder(tmp_path / "a" / "b", "", overwrite=False)
    with pytest.raises(RuntimeError), results_in(folder, Record(quiet=True), replace=False):
        raise RuntimeError
    release()
    assert list(tmp_path.iterdir()) == []


def test_results_that_are_replaced_are_none_while_others_are_written(tmp_path):
    """Killed in the middle, a folder must not look like results, old or new, and its log says what happened."""
    write_results(tmp_path, record=Record(("run",), quiet=True))
    with results_in(tmp_path, Record(("run", "--overwrite"), quiet=True), replace=True):
        assert not any((tmp_path / mark).exists() for mark in MARKS)
        assert "ended     not yet: its results are being written" in (tmp_path / LOG).read_text()
        # what the log names is still known to whoever replaces them next
        assert files_of(tmp_path) == ["summary.json"]
    assert "not yet" not in (tmp_path / LOG).read_text()


def test_a_full_disk_is_what_is_said_of_a_full_disk(tmp_path, monkeypatch):
    """Not that the log of it could not be written."""

    def full(*_values, **_named):
        raise OSError(28, "No space left on device", "log")

    (tmp_path / "result.vtu").write_text("x")
    monkeypatch.setattr(Record, "write", full)
    with pytest.raises(OSError, match="result"), results_in(tmp_path, Record(quiet=True), replace=False):
        raise OSError(28, "No space left on device", "result.vtu")


def test_a_failure_after_some_files_is_in_the_log(tmp_path):
    record = Record(("run", "--case", "a b"), quiet=True)
    (tmp_path / "result.vtu").write_text("x")
    with pytest.raises(OSError, match="full"), results_in(tmp_path, record, replace=False):
        raise OSError("disk is\nfull")
    text = (tmp_path / LOG).read_text()
    assert "command   warpbrain run --case 'a b'\n" in text
    assert "ended     OSError: disk is full\n" in text


def test_files_of_the_results_that_are_replaced_go(tmp_path):
    """Those that the log names and nothing else; what was printed is no list of files, whatever a title says."""
    record = Record(quiet=True)
    record.say("file      notes.txt")
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "explained").mkdir()
    (tmp_path / "explained" / "case.toml").write_text("")
    record.files += ["old.csv", "explained", "../outside.txt"]
    (tmp_path / "old.csv").write_text("")
    outside = tmp_path.parent / "outside.txt"
    outside.write_text("mine")
    write_results(tmp_path, record=record)
    assert files_of(tmp_path) == ["old.csv", "explained", "../outside.txt", "summary.json"]
    write_results(tmp_path, replace=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["notes.txt", "summary.json", LOG]
    assert outside.read_text() == "mine"


def test_a_log_goes_on_beside_earlier_results(tmp_path):
    write_results(tmp_path, "result.vtu")
    write_results(tmp_path, "displacement.nii.gz")
    assert files_of(tmp_path) == ["result.vtu", "displacement.nii.gz"]


def test_warnings_are_kept_and_shown(tmp_path, capsys):
    record = Record(quiet=True)
    record.note(device="CPU")
    with warnings.catch_warnings(record=True) as shown, record.warnings_kept():
        warnings.simplefilter("always")
        warnings.warn("of a\nlibrary", UserWarning, stacklevel=1)
    assert len(shown) == 1
    record.say("printed", "too")
    record.write(tmp_path, "done")
    assert capsys.readouterr().out == ""
    lines = (tmp_path / LOG).read_text().splitlines()
    assert "device    CPU" in lines
    assert "warning   UserWarning: of a library" in lines
    assert lines[-3:] == ["    printed", "    too", ""]
