"""What tests of the command line share: pictures are put together, and drawn where a test asks for `drawn`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from warpbrain.report import picture, views
from warpbrain.report.rendering.scene import NAMES


@pytest.fixture(autouse=True, scope="module")
def blank():
    """White bodies: the renderer takes seconds, and `tests/report/test_picture.py` looks at what it makes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            picture,
            "render",
            lambda _scene, _cameras, size: {name: np.full((size[1], size[0], 3), 255, np.uint8) for name in NAMES},
        )
        yield


@pytest.fixture
def drawn() -> None:
    """Curves are drawn. Of most runs nobody looks at them: how they are drawn is tested by `tests/report`."""


@pytest.fixture(autouse=True)
def _pictures(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if "drawn" not in request.fixturenames:
        monkeypatch.setattr(views, "save", _not_drawn)


def _not_drawn(figure: object, path: Path) -> None:
    assert figure is not None
    path.write_bytes(b"\x89PNG")
