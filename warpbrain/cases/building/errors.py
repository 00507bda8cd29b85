"""What can go wrong while building meshes, in one line for the user."""

from __future__ import annotations

import importlib.util
from collections.abc import Collection

from warpbrain.errors import InputError

# module to import: name on the package index
_EXTRA = {"mmgpy": "mmgpy", "nilearn": "nilearn", "nibabel": "nibabel", "scipy": "scipy", "meshio": "meshio"}


class BuildError(InputError):
    """A mesh could not be built; the message says why and what to do."""


def require_extra(modules: Collection[str] = tuple(_EXTRA)) -> None:
    """Stop with a plain sentence if one of the packages that only building needs is missing."""
    missing = [
        name for module, name in _EXTRA.items() if module in modules and importlib.util.find_spec(module) is None
    ]
    if missing:
        raise BuildError(
            f"building meshes needs {', '.join(missing)}, not installed here: pip install 'warpbrain[build]'. "
            "Running the shipped cases does not need it."
        )
