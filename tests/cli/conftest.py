"""Commands draw without the renderer, which takes seconds: `tests/report/test_picture.py` looks at pictures."""

import numpy as np
import pytest

from warpbrain.report import picture
from warpbrain.report.rendering.scene import NAMES


@pytest.fixture(autouse=True, scope="module")
def blank():
    """White pictures."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            picture,
            "render",
            lambda _scene, _cameras, size: {name: np.full((size[1], size[0], 3), 255, np.uint8) for name in NAMES},
        )
        yield
