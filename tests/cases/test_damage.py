"""Random damage to a folder gives the same case or a clear error: never a traceback, a hang or a guess."""

import shutil
import tempfile
from pathlib import Path

import pytest
from folders import write_recorded
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from same_case import assert_same

from warpbrain.cases.reading import read_case
from warpbrain.errors import InputError

FILES = ("case.toml", "mesh.vtu", "recordings/beads.csv", "recordings/lid.csv", "recordings/cell.csv")
SETTINGS = settings(max_examples=15, suppress_health_check=list(HealthCheck), derandomize=True)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return write_recorded(tmp_path_factory.mktemp("whole"))


@pytest.fixture(scope="module")
def intact(whole):
    return read_case(whole)


def damaged(whole: Path, name: str, content: bytes | None):
    """The case with a file replaced or gone: read, or the message with which it was refused."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "case"
        shutil.copytree(whole, folder)
        if content is None:
            (folder / name).unlink()
        else:
            (folder / name).write_bytes(content)
        try:
            return read_case(folder)
        except InputError as error:
            message = str(error)
            assert "\n" not in message
            assert place in message, message
            assert len(message) < 1000
            return message


@pytest.mark.parametrize("name", FILES)
@SETTINGS
@given(share=st.floats(0.0, 1.0, exclude_max=True))
def test_cut_off(whole, name, share):
    """Rows that are cut off whole leave no trace; a row that is cut is an error, or remarked if it could be whole."""
    content = (whole / name).read_bytes()
    cut = content[: int(share * len(content))]
    found = damaged(whole, name, cut)
    if name == "mesh.vtu" and cut.strip() != content.strip():
        assert isinstance(found, str)
    elif name.endswith(".csv") and not isinstance(found, str):
        assert cut.endswith(b"\n") or "is the file cut off?" in found.remarks[0]


@pytest.mark.parametrize("name", FILES)
@SETTINGS
@given(data=st.data())
def test_changed_bytes(whole, name, data):
    content = bytearray((whole / name).read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    damaged(whole, name, bytes(content))


@pytest.mark.parametrize("name", FILES)
@SETTINGS
@given(data=st.data())
def test_lines_gone_doubled_and_shuffled(whole, name, data):
    lines = (whole / name).read_bytes().splitlines(keepends=True)
    some = data.draw(st.lists(st.sampled_from(range(len(lines))), min_size=0, max_size=2 * len(lines)))
    damaged(whole, name, b"".join(lines[k] for k in some))


@pytest.mark.parametrize("name", FILES)
@SETTINGS
@given(content=st.binary(max_size=300))
def test_something_else(whole, name, content):
    found = damaged(whole, name, content)
    assert isinstance(found, str)


@pytest.mark.parametrize("name", FILES)
def test_gone(whole, name):
    assert "no such file" in damaged(whole, name, None)


@pytest.mark.parametrize("name", [name for name in FILES if name != "mesh.vtu"])
@SETTINGS
@given(data=st.data())
def test_what_means_nothing_changes_nothing(whole, intact, name, data):
    """Blank lines, comments, other line ends and a byte order mark."""
    lines = (whole / name).read_bytes().splitlines()
    for _ in range(data.draw(st.integers(0, 4))):
        extra = data.draw(st.sampled_from([b"", b"# a remark", b"   "]))
        lines.insert(data.draw(st.integers(0, len(lines))), extra)
    end = data.draw(st.sampled_from([b"\n", b"\r\n"]))
    mark = data.draw(st.sampled_from([b"", b"\xef\xbb\xbf"]))
    found = damaged(whole, name, mark + end.join(lines) + end)
    assert not isinstance(found, str), found
    assert_same(found, intact)
