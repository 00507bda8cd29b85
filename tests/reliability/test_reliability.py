"""The tool that counts tries (`python -m reliability`): nothing is lost, done twice, or taken for right."""

import os
import signal
import time

import pytest

from reliability.kinds import KINDS, Kind, Tried
from reliability.running import try_all
from reliability.table import table_of, tries_in

pytestmark = pytest.mark.skipif(os.name != "posix", reason="forks")


def kind(trying, **named):
    return Kind(4, lambda _place: trying, **named)


def test_each_try_is_a_line_and_done_once(tmp_path, monkeypatch):
    monkeypatch.setitem(KINDS, "sound", kind(lambda seed: Tried("change", "computed", 10.0**-seed)))
    out = tmp_path / "tries.jsonl"
    assert not try_all(["sound"], 0, 0, 2, None, out) and tries_in([out]) == []
    assert not try_all(["sound"], 2, 0, 2, None, out)
    assert not try_all(["sound"], None, 0, 2, None, out)
    assert sorted(one["seed"] for one in tries_in([out])) == [0, 1, 2, 3] and len(out.read_text().splitlines()) == 4
    assert "| sound | 4 | 0 | 4 computed; they differ by 5.5e-02 in the median, 1.0e+00 at most |" in table_of([out])


def test_what_is_wrong_or_dies_is_told_and_the_rest_goes_on(tmp_path, monkeypatch):
    def trying(seed):
        if seed == 0:
            os._exit(9)
        if seed == 1:
            raise KeyError("x")
        return Tried("", "read", None, "printed" if seed == 2 else "")

    monkeypatch.setitem(KINDS, "bad", kind(trying))
    monkeypatch.setitem(KINDS, "lacking", kind(trying, packages=("no_such_package",)))
    out = tmp_path / "tries.jsonl"
    assert try_all(["bad", "lacking"], None, 0, 1, None, out)
    defects = {one["seed"]: one["defect"] for one in tries_in([out])}
    assert defects[0] == "its process ended: 9" and "KeyError: 'x'" in defects[1]
    assert (defects[2], defects[3], len(defects)) == ("printed", "", 4)


def test_what_takes_too_long_is_given_up(tmp_path, monkeypatch):
    def trying(seed):
        # with a process of its own
        time.sleep(0.0 if seed == 3 else 60.0) if seed == 3 or os.fork() else time.sleep(60.0)
        return Tried("", "read")

    monkeypatch.setitem(KINDS, "slow", kind(trying))
    out, began = tmp_path / "tries.jsonl", time.monotonic()
    assert not try_all(["slow"], None, 0, 4, 2.0, out)
    assert time.monotonic() - began < 20.0
    assert [one["seed"] for one in tries_in([out])] == [3]


def test_what_computes_without_end_is_wrong(tmp_path, monkeypatch):
    def trying(seed):
        while True:
            pass

    monkeypatch.setitem(KINDS, "endless", Kind(1, lambda _place: trying, lasts=-2.9))
    out = tmp_path / "tries.jsonl"
    assert try_all(["endless"], None, 0, 1, 60.0, out)
    assert tries_in([out])[0]["defect"] == f"its process ended: {-signal.SIGXCPU}"


def test_what_does_not_fit_in_the_time_left_is_not_begun(tmp_path, monkeypatch, capfd):
    monkeypatch.setitem(KINDS, "long", Kind(4, lambda _place: time.sleep, lasts=60.0))
    monkeypatch.setitem(KINDS, "short", kind(lambda _seed: Tried("", "read")))
    out = tmp_path / "tries.jsonl"
    assert not try_all(["long", "short"], None, 0, 2, 20.0, out)
    assert [one["kind"] for one in tries_in([out])] == ["short"] * 4
    assert "given up" not in capfd.readouterr().out
