"""What tests of the command line share: pictures are put together, and drawn where a test asks for `drawn`."""

from __future__ import annotations

import pytest
from not_drawn import RENDERER, BegunLate, not_drawn, not_laid_out, white

from warpbrain.report import picture, views


@pytest.fixture(autouse=True, scope="module")
def blank():
    """White bodies: the renderer takes seconds, and `tests/report/test_picture.py` looks at what it makes.

    Nor is its process begun ahead, which takes one more until it has loaded what it draws with.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(picture, "render", white)
        patch.setattr(RENDERER, BegunLate)
        yield


@pytest.fixture
def drawn() -> None:
    """Figures are laid out and drawn. At those of most runs nobody looks: `tests/report` tests how that is done."""


@pytest.fixture(autouse=True)
def _pictures(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if "drawn" not in request.fixturenames:
        monkeypatch.setattr(views, "lay_out", not_laid_out)
        monkeypatch.setattr(views, "write_png", not_drawn)
