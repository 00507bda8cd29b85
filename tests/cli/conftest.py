"""What tests of the command line share: pictures are put together, and drawn where a test asks for `drawn`."""

from __future__ import annotations

from unittest.mock import MagicMock

import pytest
from not_drawn import RENDERER, not_drawn, white

from warpbrain.report import picture, views


@pytest.fixture(autouse=True, scope="module")
def blank():
    """White bodies: the renderer takes seconds, and `tests/report/test_picture.py` looks at what it makes.

    Nor is its process begun, which takes one more until it has loaded what it draws with.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(picture, "render", white)
        patch.setattr(RENDERER, MagicMock)
        yield


@pytest.fixture
def drawn() -> None:
    """Curves are drawn. Of most runs nobody looks at them: how they are drawn is tested by `tests/report`."""


@pytest.fixture(autouse=True)
def _pictures(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if "drawn" not in request.fixturenames:
        monkeypatch.setattr(views, "write_png", not_drawn)
