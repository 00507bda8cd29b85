"""Are two cases the same, as far as files hold them?"""

from dataclasses import fields, is_dataclass
from pathlib import Path

import numpy as np

from warpbrain.mesh import TetMesh


def assert_same(a, b, where="case"):
    """Equal as far as the files hold it: lengths to rounding."""
    if is_dataclass(a) and not isinstance(a, type):
        assert type(a) is type(b), where
        for field in fields(a):
            # where it came from, and what was said of that file
            if field.name not in ("path", "mesh_file", "file", "moved_file", "remarks"):
                assert_same(getattr(a, field.name), getattr(b, field.name), f"{where}.{field.name}")
    elif isinstance(a, str | bool | type(None) | Path):
        assert a == b, where
    elif isinstance(a, TetMesh) or hasattr(a, "keys"):
        assert sorted(a) == sorted(b), where
        for key in a:
            assert_same(a[key], b[key], f"{where}[{key}]")
    elif isinstance(a, tuple | list) and any(not isinstance(item, int | float) for item in a):
        assert len(a) == len(b), where
        for number, (x, y) in enumerate(zip(a, b, strict=True)):
            assert_same(x, y, f"{where}[{number}]")
    else:
        np.testing.assert_allclose(np.asarray(a), np.asarray(b), rtol=1e-14, atol=1e-17, err_msg=where)
