"""Labels come back only if they are those that were committed to."""

import pytest
from said import label, sealed_labels

from concealed.sealing import read_sealed, write_sealed
from referee.errors import InputError
from referee.sealed import open_labels


@pytest.fixture
def labels(tmp_path):
    sealed_labels(tmp_path, label("a"), label("b", "effect", ("gravity",), 9.0))
    return tmp_path


def test_committed_labels_open(labels):
    opened = open_labels(labels, labels / "commitments.txt")
    assert sorted(opened) == ["a", "b"]
    assert opened["b"]["names"] == ["gravity"]
    assert len(opened["a"]["salt"]) == 64


def test_a_tampered_label_is_refused(labels):
    file = labels / "b.json.gz"
    write_sealed(file, read_sealed(file).replace(b"gravity", b"swelling"))
    with pytest.raises(InputError, match=r"b\.json\.gz: its hash is"):
        open_labels(labels, labels / "commitments.txt")


def test_labels_that_swapped_names_are_refused(labels):
    data = {name: read_sealed(labels / f"{name}.json.gz") for name in "ab"}
    write_sealed(labels / "a.json.gz", data["b"])
    with pytest.raises(InputError, match=r"a\.json\.gz"):
        open_labels(labels, labels / "commitments.txt")


def test_a_missing_or_a_new_label_is_refused(labels):
    published = labels / "published.txt"
    published.write_text((labels / "commitments.txt").read_text())
    (labels / "a.json.gz").rename(labels / "c.json.gz")
    with pytest.raises(InputError, match="no hash of 'c'"):
        open_labels(labels, published)
    (labels / "c.json.gz").unlink()
    with pytest.raises(InputError, match="no label of a"):
        open_labels(labels, published)
