"""Files are there whole or not at all."""

import os
import stat

import pytest

from warpbrain import atomic
from warpbrain.atomic import check_writable, output_folder, remove_unfinished, whole_file, whole_folder
from warpbrain.errors import InputError


def test_a_file_appears_when_it_is_whole(tmp_path):
    path = tmp_path / "a.json"
    with whole_file(path) as temporary:
        assert temporary.parent == path.parent
        assert temporary.suffix == path.suffix
        temporary.write_text("new")
        assert not path.exists()
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt, SystemExit])
def test_an_error_leaves_the_old_file(tmp_path, error):
    path = tmp_path / "a.json"
    path.write_text("old")

    def write() -> None:
        with whole_file(path) as temporary:
            temporary.write_text("ne")
            raise error("stopped")

    with pytest.raises(error, match="stopped"):
        write()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("folder", [False, True])
def test_content_is_on_the_disk_before_its_name(tmp_path, monkeypatch, folder):
    """After a power failure a file that was renamed sooner may be empty."""
    path, events = tmp_path / "a", []

    def fsync(descriptor):
        events.append((os.fstat(descriptor).st_ino, path.exists()))

    monkeypatch.setattr(atomic.os, "fsync", fsync)
    with (whole_folder if folder else whole_file)(path) as temporary:
        file = temporary / "inside" if folder else temporary
        file.write_text("new")
        inode = file.stat().st_ino
    assert events[0] == (inode, False)
    # and then the name is
    assert events[-1] == (tmp_path.stat().st_ino, True)


def test_content_that_the_disk_does_not_take_gets_no_name(tmp_path, monkeypatch):
    """A full disk may be known only then."""

    def fsync(_descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(atomic.os, "fsync", fsync)
    with pytest.raises(OSError, match="No space left"), whole_file(tmp_path / "a") as temporary:
        temporary.write_text("new")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("mask", [0o022, 0o077, 0o002])
def test_permissions_are_those_of_any_new_file(tmp_path, mask):
    before = os.umask(mask)
    try:
        with whole_file(tmp_path / "a") as temporary:
            temporary.write_text("x")
    finally:
        assert os.umask(before) == mask
    assert stat.S_IMODE((tmp_path / "a").stat().st_mode) == 0o666 & ~mask


def test_what_is_unfinished_can_be_removed_from_outside(tmp_path):
    def write() -> None:
        with whole_file(tmp_path / "a.json") as temporary:
            temporary.write_text("x")
            remove_unfinished()
            assert not list(tmp_path.iterdir())

    with pytest.raises(FileNotFoundError):
        write()
    assert not list(tmp_path.iterdir())


def test_a_folder_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match="none: cannot be written to"), whole_file(tmp_path / "none" / "a"):
        pass


def test_a_name_that_a_folder_has(tmp_path):
    (tmp_path / "a").mkdir()
    with pytest.raises(InputError, match="a: cannot be written: there is a folder of that name"):
        check_writable(tmp_path / "a")
    with pytest.raises(InputError, match="there is a folder"), whole_file(tmp_path / "a"):
        pass


def test_a_folder_that_cannot_be_written(tmp_path, monkeypatch):
    # root may write anywhere, and tests often run as root: the answer of the system is stood in for
    monkeypatch.setattr(atomic.os, "access", lambda path, mode: False)
    for attempt in (lambda: check_writable(tmp_path / "a"), lambda: output_folder(tmp_path)):
        with pytest.raises(InputError, match="cannot be written to"):
            attempt()


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_the_right_to_write(tmp_path):
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(InputError, match="cannot be written to"), whole_file(tmp_path / "a"):
            pass
    finally:
        tmp_path.chmod(0o700)


def test_output_folder_is_made_with_its_parents(tmp_path):
    made = output_folder(tmp_path / "a" / "b")
    assert made.is_dir()
    assert output_folder(made) == made


def test_output_folder_cannot_be_a_file(tmp_path):
    (tmp_path / "a").write_text("x")
    for path in (tmp_path / "a", tmp_path / "a" / "b"):
        with pytest.raises(InputError, match="cannot be made a folder"):
            output_folder(path)


@pytest.mark.parametrize("empty", [False, True])
def test_a_folder_appears_when_it_is_whole(tmp_path, empty):
    path = tmp_path / "a"
    if empty:
        path.mkdir()
    with whole_folder(path) as temporary:
        assert temporary.parent == path.parent
        (temporary / "inside").mkdir()
        (temporary / "inside" / "b").write_text("new")
        assert not path.exists() or not list(path.iterdir())
    assert (path / "inside" / "b").read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt, SystemExit])
def test_an_error_leaves_no_folder(tmp_path, error):
    def write() -> None:
        with whole_folder(tmp_path / "a") as temporary:
            (temporary / "b").write_text("ne")
            raise error("stopped")

    with pytest.raises(error, match="stopped"):
        write()
    assert not list(tmp_path.iterdir())


def test_an_unfinished_folder_can_be_removed_from_outside(tmp_path):
    def write() -> None:
        with whole_folder(tmp_path / "a") as temporary, whole_file(temporary / "b") as file:
            file.write_text("x")
            remove_unfinished()
            assert not list(tmp_path.iterdir())

    with pytest.raises(FileNotFoundError):
        write()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("mask", [0o022, 0o077])
def test_a_folder_has_the_rights_of_any_new_folder(tmp_path, mask):
    before = os.umask(mask)
    try:
        with whole_folder(tmp_path / "a"):
            pass
    finally:
        assert os.umask(before) == mask
    assert stat.S_IMODE((tmp_path / "a").stat().st_mode) == 0o777 & ~mask


def test_places_where_no_new_folder_can_be(tmp_path):
    (tmp_path / "file").write_text("x")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "b").write_text("y")
    (tmp_path / "nowhere").symlink_to(tmp_path / "gone")
    for name, message in {
        "file": "there is a file of that name",
        "nowhere": "there is a file of that name",
        "full": "there is a folder of that name that is not empty",
        "none/a": "none: cannot be written to: no such folder",
    }.items():
        with pytest.raises(InputError, match=message), whole_folder(tmp_path / name):
            pass
    assert (tmp_path / "file").read_text() + (tmp_path / "full" / "b").read_text() == "xy"
