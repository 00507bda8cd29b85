"""`warpbrain doctor`: what it says of this machine, and what it says of one that computes wrongly."""

import json
import platform

import pytest
from command import warpbrain

from warpbrain.bench import health as module
from warpbrain.bench.health import TOLERANCE


def test_a_sound_machine():
    done = warpbrain("doctor")
    assert done.status == 0, done.err
    for word in ("warpbrain ", "python ", "processor ", "memory ", "warp-lang ", "cuda ", "device ", "kernels "):
        assert f"{word}" in done.out
    assert "self-test  cpu: passed" in done.out


def test_json_has_what_a_report_needs():
    found = json.loads(warpbrain("doctor", "--json").out)
    assert found["python"] == platform.python_version()
    assert found["packages"]["numpy"] and found["devices"][0]["alias"] == "cpu"
    (test, *_) = found["self_test"]
    assert test["problem"] == "" and test["error"] < TOLERANCE and test["nodes"] > 100


@pytest.mark.parametrize("wrong", [1.0 + 1e-4, float("nan")])
def test_a_machine_that_is_wrong_is_told(monkeypatch, wrong):
    solved = module.solve_equilibrium

    def solve(system):
        state = solved(system)
        state.u[:] *= wrong
        return state

    monkeypatch.setattr(module, "solve_equilibrium", solve)
    done = warpbrain("doctor")
    assert done.status == 1
    assert "self-test  cpu: FAILED" in done.out
    assert "the self-test failed on cpu" in done.err
