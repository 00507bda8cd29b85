"""Renders a scene in a process of its own: where there is no graphics library, VTK does not raise but crashes."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.report.rendering.scene import NAMES, Camera, Scene, write_scene

#: Longest that rendering may take [s]: a driver that hangs must not hold a result back.
_LONGEST = 300.0


class RenderingError(Exception):
    """Nothing can be rendered on this machine; says why, and what helps."""


def render(scene: Scene, cameras: Mapping[str, Camera], size: tuple[int, int]) -> dict[str, Any]:
    """The pictures of a scene that have cameras by name, each (height, width, 3) uint8.

    Raises
    ------
    RenderingError
        If there is no graphics library, or it fails.
    """
    with tempfile.TemporaryDirectory(prefix="warpbrain-") as name:
        folder = Path(name)
        write_scene(folder, scene, cameras, size)
        command = [sys.executable, "-m", "warpbrain.report.rendering", name]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=_LONGEST)
        except subprocess.TimeoutExpired:
            raise RenderingError(f"rendering took longer than {_LONGEST:.0f} s") from None
        written = folder / "pictures.npy"
        if done.returncode or not written.is_file():
            raise RenderingError(_why(done.returncode, done.stderr))
        image = np.load(written)
    names = [name for name in NAMES if name in cameras]
    return dict(zip(names, np.split(image, len(names), axis=1), strict=True))


def _why(status: int, said: str) -> str:
    if status < 0:
        return (
            f"VTK crashed (signal {-status}), as it does where there is no OpenGL library: "
            "on Debian and Ubuntu, apt-get install libegl1"
        )
    lines = said.strip().splitlines()
    return lines[-1][:300] if lines else f"the rendering process ended with status {status}"
