"""Bodies as PyVista renders them, in a process of its own: a graphics library that fails takes nothing along.

`render` writes a `Scene`, plain arrays of a deformed body, into a folder, from which `rendering.drawing` makes pictures
in another process: where there is no graphics library, VTK does not raise but crashes. The process can be begun before
there is a scene (`ready_to_render`): its libraries take as long to load as a picture to be drawn.
"""

import pickle
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints

#: Names of the pictures, in the order in which they are rendered.
BEFORE, AFTER, MOTION, AXIAL, CORONAL, SAGITTAL = "before", "after", "motion", "axial", "coronal", "sagittal"
CUTS = {AXIAL: 2, CORONAL: 1, SAGITTAL: 0}
NAMES = (BEFORE, AFTER, MOTION, *CUTS)
#: Colours of Okabe and Ito of what was recorded and of what was computed.
RECORDED, COMPUTED = "#d55e00", "#0072b2"
#: File of a scene, its cameras and the size of a picture [pixel], for the process that renders.
SCENE = "scene.pickle"
#: Longest that rendering may take [s]: a driver that hangs must not hold a result back.
_LONGEST = 300.0
#: A process that waits for a scene.
_ready: list[subprocess.Popen[str]] = []


class RenderingError(Exception):
    """Nothing can be rendered on this machine; says why, and what helps."""


@dataclass(frozen=True, eq=False)
class Camera:
    """Where a body is seen from, without perspective."""

    #: Of the picture, in RAS (3,); unit vectors at right angles.
    right: Floats
    up: Floats
    #: In the middle of the picture (3,), and half its height [mm].
    centre: Floats
    half_height: float

    @property
    def towards(self) -> Floats:
        """From the body to the viewer (3,)."""
        return np.cross(self.right, self.up)


@dataclass(frozen=True, eq=False)
class Scene:
    """A body before and after, and what was recorded of it; lengths in mm, axes RAS."""

    #: Nodes before (n, 3), tetrahedra (m, 4), which of these are there before and not after, and colours of their
    #: tissue (m, 3) uint8.
    points: Floats
    tetrahedra: Ints
    removed: Bools
    colours: Any
    #: Displacement (n, 3), and how many times as far as it moves the body is drawn after.
    u: Floats
    exaggeration: float
    #: A corner is cut out of the body there (3,), on the side of the viewer; coordinates x, y, z of the three cuts.
    corner: Floats
    places: Floats
    #: Points (k, 3), how far they moved, and how far the body moves there; of no points if none were recorded.
    where: Floats
    recorded: Floats
    computed: Floats
    #: How many times as long as they are the arrows of `recorded` and `computed` are drawn.
    arrows: float
    #: The displacement of the last colour, and the colours from zero to it (256, 3) uint8.
    top: float
    table: Any

    @property
    def side(self) -> Floats:
        """Signs of the corner that is cut out: where there is most to see, above.

        That is what was removed, else what was recorded, else the left and the front.
        """
        seen = self.points[self.tetrahedra[self.removed]].reshape(-1, 3)
        seen = self.where if not len(seen) else seen
        middle = 0.5 * (self.points.min(axis=0) + self.points.max(axis=0))
        offset = seen.mean(axis=0) - middle if len(seen) else np.zeros(3)
        return np.array([1.0 if offset[0] > 0.0 else -1.0, -1.0 if offset[1] < 0.0 else 1.0, 1.0])


def render(scene: Scene, cameras: Mapping[str, Camera], size: tuple[int, int]) -> dict[str, Any]:
    """The pictures of a scene that have cameras by name, each (height, width, 3) uint8; `size` is width and height.

    `RenderingError` if there is no graphics library, or it fails.
    """
    with tempfile.TemporaryDirectory(prefix="warpbrain-") as name, _ready.pop() if _ready else _begin() as process:
        folder = Path(name)
        (folder / SCENE).write_bytes(pickle.dumps((scene, dict(cameras), size)))
        try:
            _, said = process.communicate(name, timeout=_LONGEST)
        except subprocess.TimeoutExpired:
            process.kill()
            raise RenderingError(f"rendering took longer than {_LONGEST:.0f} s") from None
        except BaseException:
            process.kill()
            raise
        written = folder / "pictures.npy"
        if process.returncode < 0:
            raise RenderingError(
                f"VTK crashed (signal {-process.returncode}), as it does where there is no OpenGL library: "
                "on Debian and Ubuntu, apt-get install libegl1"
            )
        if process.returncode or not written.is_file():
            lines = said.strip().splitlines()
            why = lines[-1][:300] if lines else f"the rendering process ended with status {process.returncode}"
            raise RenderingError(why)
        image = np.load(written)
    names = [name for name in NAMES if name in cameras]
    return dict(zip(names, np.split(image, len(names), axis=1), strict=True))


@contextmanager
def ready_to_render() -> Iterator[None]:
    """While it lasts, the process of the next `render` is there, and loads its libraries beside whatever else is done.

    It ends with the block, rendering or not, with `render_nothing`, and by itself if this process is gone.
    """
    process = _begin()
    _ready.append(process)
    try:
        yield
    finally:
        process.kill()
        if process in _ready:
            _ready.remove(process)
            with process:
                pass


def render_nothing() -> None:
    """End the process that waits for a scene, if there is one."""
    for process in _ready:
        process.kill()


def _begin() -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "warpbrain.report.rendering.drawing"]
    piped = subprocess.PIPE
    return subprocess.Popen(command, stdin=piped, stdout=piped, stderr=piped, text=True)
