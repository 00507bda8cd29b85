"""Rendering that fails: said, with what helps, and nothing is taken along."""

import stat
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from busy import slowness

from warpbrain.report import rendering
from warpbrain.report.rendering import RenderingError, Scene, ready_to_render, render, render_nothing

SCENE = Scene(
    points=np.eye(4, 3), tetrahedra=np.array([[0, 1, 2, 3]]), removed=np.array([False]),
    colours=np.zeros((1, 3), np.uint8), u=np.ones((4, 3)), exaggeration=5.0, corner=np.zeros(3), places=np.zeros(3),
    where=np.zeros((0, 3)), recorded=np.zeros((0, 3)), computed=np.zeros((0, 3)), arrows=1.0, top=2.0,
    table=np.zeros((256, 3), np.uint8),
)  # fmt: skip


@pytest.mark.parametrize(
    ("script", "why"),
    [
        ("kill -SEGV $$", r"VTK crashed \(signal 11\).*libegl1"),
        ("echo first >&2; echo 'ImportError: no vtk' >&2; exit 1", "^ImportError: no vtk$"),
        ("exit 3", "ended with status 3"),
        ("exit 0", "ended with status 0"),
        ("sleep 5", "longer than"),
    ],
)
def test_why_nothing_is_rendered(tmp_path, monkeypatch, script, why):
    program = tmp_path / "python"
    program.write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setattr(rendering.sys, "executable", str(program))
    monkeypatch.setattr(rendering, "_LONGEST", 0.5)
    with pytest.raises(RenderingError, match=why):
        render(SCENE, {}, (10, 10))


def test_a_process_that_is_there_renders_once(tmp_path, monkeypatch):
    program = tmp_path / "python"
    program.write_text(f"#!/bin/sh\necho begun >> {tmp_path}/log\ncat > /dev/null\nexit 4\n", encoding="utf-8")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setattr(rendering.sys, "executable", str(program))
    with ready_to_render():
        for _ in range(2):
            with pytest.raises(RenderingError, match="ended with status 4"):
                render(SCENE, {}, (10, 10))
    assert (tmp_path / "log").read_text(encoding="utf-8") == "begun\n" * 2


def test_a_process_that_is_not_needed_ends(monkeypatch):
    begun = []
    monkeypatch.setattr(rendering, "_begin", lambda begin=rendering._begin: begun.append(begin()) or begun[-1])
    with ready_to_render():
        assert begun[0].poll() is None
    assert begun[0].returncode is not None and not rendering._ready
    with ready_to_render():
        render_nothing()
        assert begun[1].wait(60.0 * slowness()) != 0
    assert not rendering._ready


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="asks Linux what processes there are")
def test_a_process_ends_with_the_one_that_began_it():
    script = """
import os
from warpbrain.report import rendering
with rendering.ready_to_render():
    print(rendering._ready[0].pid, flush=True)
    os._exit(130)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 130
    end = time.monotonic() + 60.0 * slowness()
    while _is_there(int(done.stdout)):
        assert time.monotonic() < end
        time.sleep(0.05)


def _is_there(process: int) -> bool:
    """Whether a process is there that is not this one's child, nor a dead one that nobody asked about."""
    try:
        state = Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"
