"""Where nothing is rendered and no file of a curve is drawn, which is most of the time of a small case and needs
libraries that compute servers lack: `PYTHONPATH=tests python -m not_drawn diagnose ...` is `warpbrain diagnose ...`."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from subprocess import Popen
from typing import Any, BinaryIO
from unittest.mock import patch

import numpy as np

from warpbrain.cli import main
from warpbrain.report.rendering import NAMES, _begin
from warpbrain.report.slices import Cut


@contextmanager
def nothing_drawn() -> Iterator[None]:
    """Pictures are white, cuts through bodies empty."""
    with ExitStack() as stack:
        for target, stand_in in _STAND_INS:
            stack.enter_context(patch(target, stand_in))
        yield


def white(_scene: object, _cameras: object, size: tuple[int, int]) -> dict[str, np.ndarray]:
    return {name: np.full((size[1], size[0], 3), 255, np.uint8) for name in NAMES}


class BegunLate:
    """The process that renders, begun when something is rendered: it loads its libraries for nothing in most tests."""

    def __init__(self) -> None:
        self._process: Popen[str] | None = None
        self._killed = False

    def kill(self) -> None:
        self._killed = True

    def __enter__(self) -> Popen[str] | None:
        if not self._killed:
            self._process = _begin()
        return self._process

    def __exit__(self, *error: Any) -> None:
        if self._process is not None:
            self._process.__exit__(*error)


def not_drawn(figure: object, stream: BinaryIO, _dpi: float) -> None:
    """A file of curves, of a page or by itself, without any: how they are drawn is tested by `tests/report`."""
    assert figure is not None
    stream.write(b"\x89PNG" + bytes(5000) + b"IEND\xaeB`\x82")


def not_laid_out(figure: object, _dpi: float = 0.0) -> None:
    """Nothing of a figure is measured, which takes as long as all else of a run of a small case."""
    assert figure is not None


def _empty(_mesh: object, fields: Any, _u: object, name: str, _axis: int, _place: float) -> dict[str, object]:
    return {"name": name, "points": "", "triangles": "", "moves": None, "values": [""] * len(fields)}


def _no_cut(_points: object, _cells: object, _values: object, _axis: int, _position: float) -> Cut:
    none, numbers = np.zeros(0), np.zeros((0, 3), np.int64)
    return Cut([], np.zeros(0, np.int64), none, np.zeros((0, 2)), numbers, none)


def _no_outline(*_args: object) -> np.ndarray:
    return np.zeros((0, 2, 2))


#: What begins the process that renders.
RENDERER = "warpbrain.report.rendering._begin"
_STAND_INS: tuple[tuple[str, Callable[..., object]], ...] = (
    # before what imports them by name
    ("warpbrain.report.slices.cut", _no_cut),
    ("warpbrain.report.slices.outline", _no_outline),
    ("warpbrain.report.picture.render", white),
    (RENDERER, BegunLate),
    ("warpbrain.report.views.lay_out", not_laid_out),
    ("warpbrain.report.views.write_png", not_drawn),
    ("warpbrain.report.page.scene._cut", _empty),
)

if __name__ == "__main__":
    with nothing_drawn():
        sys.exit(main(sys.argv[1:]))
