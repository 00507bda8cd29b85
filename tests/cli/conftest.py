"""What tests of the command line share: pictures are put together, and drawn where a test asks for `drawn`."""

from __future__ import annotations

from pathlib import Path

import pytest

from warpbrain.report import views


@pytest.fixture
def drawn() -> None:
    """Pictures are drawn. Of most runs nobody looks at them: how they are drawn is tested by `tests/report`."""


@pytest.fixture(autouse=True)
def _pictures(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if "drawn" not in request.fixturenames:
        monkeypatch.setattr(views, "save", _not_drawn)


def _not_drawn(figure: object, path: Path) -> None:
    assert figure is not None
    path.write_bytes(b"\x89PNG")
