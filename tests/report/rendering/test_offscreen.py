"""Rendering that fails: said, with what helps, and nothing is taken along."""

import stat

import numpy as np
import pytest

from warpbrain.report import rendering
from warpbrain.report.rendering import Camera, RenderingError, Scene, read_scene, render, write_scene

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


def test_a_scene_comes_back_as_it_went(tmp_path):
    camera = Camera(np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]), np.array([1.0, 2.0, 3.0]), 4.0)
    write_scene(tmp_path, SCENE, {"a": camera}, (30, 20))
    scene, cameras, size = read_scene(tmp_path)
    assert size == (30, 20) and cameras["a"].half_height == 4.0
    np.testing.assert_array_equal(cameras["a"].towards, [0.0, -1.0, 0.0])
    for name, value in vars(SCENE).items():
        np.testing.assert_array_equal(getattr(scene, name), value)
