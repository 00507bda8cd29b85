"""A sealed truth comes back whole, and cannot be changed unseen."""

import json

import pytest

from concealed.sealing import SALT, canonical, fingerprint, open_sealed, read_sealed, sealed, write_sealed

TRUTH = {"case": "none", "strength": 0.1, "list": [1.5, -2e-9], "text": "µ"}


def test_round_trip(tmp_path):
    data = sealed(TRUTH)
    write_sealed(tmp_path / "deep" / "x.json.gz", data)
    assert read_sealed(tmp_path / "deep" / "x.json.gz") == data
    opened = open_sealed(data)
    assert len(bytes.fromhex(opened.pop("salt"))) == SALT
    assert opened == TRUTH


def test_same_bytes_give_the_same_file(tmp_path):
    data = sealed(TRUTH)
    for name in ("a", "b"):
        write_sealed(tmp_path / name, data)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_salt_makes_every_seal_another():
    assert fingerprint(sealed(TRUTH)) != fingerprint(sealed(TRUTH))


def test_fingerprint_is_sha_256():
    assert fingerprint(b"abc") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"


def test_order_of_keys_does_not_matter():
    assert canonical({"b": 1, "a": 2}) == canonical({"a": 2, "b": 1}) == b'{"a":2,"b":1}'


def test_what_was_changed_is_refused():
    data = sealed(TRUTH)
    assert fingerprint(data.replace(b"0.1", b"0.2")) != fingerprint(data)
    with pytest.raises(ValueError, match="not a sealed truth"):
        open_sealed(json.dumps(json.loads(data)).encode())
    with pytest.raises(ValueError, match="not a sealed truth"):
        open_sealed(canonical(TRUTH))


def test_a_truth_is_sealed_once():
    with pytest.raises(ValueError, match="sealed before"):
        sealed(open_sealed(sealed(TRUTH)))
