"""Progress: a bar on a terminal, gone when the work is done; lines now and then where there is none."""

import io
import sys

import pytest

from warpbrain.terminal import progress as module
from warpbrain.terminal.progress import EVERY, Progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def look_at(monkeypatch: pytest.MonkeyPatch, stream: io.StringIO) -> io.StringIO:
    """Standard error from here on; a fixture would be too early, pytest puts its own there after it."""
    monkeypatch.setattr(sys, "stderr", stream)
    return stream


def test_on_a_terminal(monkeypatch):
    terminal = look_at(monkeypatch, Terminal())
    progress = Progress("motion")
    progress.show(0.5, "15 ms")
    assert terminal.getvalue() == f"\rmotion [{'#' * 15}{'.' * 15}]  50 % {'15 ms':<40}"
    progress.clear()
    written, blank = terminal.getvalue().split("\r")[1:3]
    assert blank == " " * len(blank)
    assert len(blank) >= len(written)
    assert terminal.getvalue().endswith("\r")


@pytest.mark.parametrize(("fraction", "marks"), [(-1.0, 0), (0.0, 0), (1.0, 30), (7.0, 30)])
def test_never_leaves_its_frame(monkeypatch, fraction, marks):
    terminal = look_at(monkeypatch, Terminal())
    Progress("x").show(fraction, "n" * 200)
    assert terminal.getvalue().count("#") == marks
    assert terminal.getvalue().count("n") == 40


def test_quiet(monkeypatch):
    terminal = look_at(monkeypatch, Terminal())
    progress = Progress("motion", quiet=True)
    progress.show(0.5)
    progress.clear()
    assert terminal.getvalue() == ""


def test_in_a_file(monkeypatch):
    """Lines at most every half minute, so that short work says nothing, and no carriage returns."""
    now = [100.0]
    monkeypatch.setattr(module.time, "monotonic", lambda: now[0])
    stream = look_at(monkeypatch, io.StringIO())
    progress = Progress("motion")
    for second in range(100):
        now[0] = 100.0 + second
        progress.show(second / 100, f"{second} ms")
    progress.clear()
    assert stream.getvalue().splitlines() == [f"motion {k * EVERY:.0f} % {k * EVERY:.0f} ms" for k in (1, 2, 3)]
    assert "\r" not in stream.getvalue()


def test_in_a_file_and_quiet(monkeypatch):
    now = iter(range(0, 1000, 100))
    monkeypatch.setattr(module.time, "monotonic", lambda: float(next(now)))
    stream = look_at(monkeypatch, io.StringIO())
    Progress("motion", quiet=True).show(0.5)
    assert stream.getvalue() == ""
