"""Modules of kernels are compiled in threads, each of them once."""

import threading
from types import SimpleNamespace
from typing import Any

import pytest
import warp as wp

from warpbrain.kernels.module import begin_loading, is_compiling


def test_a_module_that_is_being_compiled_is_not_compiled_again(monkeypatch: pytest.MonkeyPatch) -> None:
    go_on, loaded = threading.Event(), []

    def load(_device: Any, modules: list[Any], _threads: int | None) -> None:
        go_on.wait(60.0)
        loaded.append(modules[0].name)

    monkeypatch.setattr(wp, "force_load", load)
    kernel: Any = SimpleNamespace(module=SimpleNamespace(name="slow"))
    waiting = [begin_loading([kernel, kernel], wp.get_device("cpu")) for _ in range(3)]
    assert is_compiling()
    go_on.set()
    for wait in waiting:
        wait()
    assert loaded == ["slow"] and not is_compiling()


def test_what_went_wrong_is_raised_and_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: Any) -> None:
        raise RuntimeError("no compiler")

    monkeypatch.setattr(wp, "force_load", fails)
    kernel: Any = SimpleNamespace(module=SimpleNamespace(name="broken"))
    wait = begin_loading([kernel], wp.get_device("cpu"))
    with pytest.raises(RuntimeError, match="no compiler"):
        wait()
    monkeypatch.setattr(wp, "force_load", lambda *_: None)
    begin_loading([kernel], wp.get_device("cpu"))()
